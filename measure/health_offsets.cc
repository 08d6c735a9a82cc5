// Offsets, steps and drifts of one camera, by what the others predict of its readings.
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "base/statistics.h"
#include "measure/health_view.h"

namespace unfurl::measure {

namespace {

constexpr std::size_t kBins = 64;  // of flashes, between which a step is looked for first
constexpr int kRounds = 8;         // of estimating and weighing anew; they settle in three or four

class Offsets {
 public:
  Offsets(const CameraView& view, const Residuals& in) : view_(view), in_(in), n_(view.size()) {}

  // The mean of the flashes [first, end) by those that are no outliers of it, from their median.
  double Level(std::size_t first, std::size_t end) {
    sorted_.clear();
    for (std::size_t i = first; i < end; ++i) {
      if (in_.weight[i] > 0.0) sorted_.push_back(in_.r[i]);
    }
    if (sorted_.empty()) return 0.0;
    double level = Median(sorted_);
    for (int round = 0; round < kRounds; ++round) {
      double sum = 0.0, weight = 0.0;
      for (std::size_t i = first; i < end; ++i) {
        if (!Good(i, level)) continue;
        sum += in_.weight[i] * in_.r[i];
        weight += in_.weight[i];
      }
      if (weight > 0.0) level = sum / weight;
    }
    return level;
  }

  double Loss(std::size_t first, std::size_t end, double level) const {
    double sum = 0.0;
    for (std::size_t i = first; i < end; ++i) sum += LossOf(view_, in_, i, level);
    return sum;
  }

  // The flash from which a step is likeliest, and the levels on either side; false: no room.
  bool Step(std::size_t* at, double* before, double* after) {
    const std::size_t bin = std::max<std::size_t>(1, n_ / kBins);
    if (n_ < 2 * bin + 2) return false;
    double best = HUGE_VAL;
    for (std::size_t j = bin; j + bin <= n_; j += bin) {
      const double loss = CoarseLoss(0, j) + CoarseLoss(j, n_);
      if (loss >= best) continue;
      best = loss;
      *at = j;
    }
    for (int round = 0; round < kRounds; ++round) {
      *before = Level(0, *at);
      *after = Level(*at, n_);
      const std::size_t was = *at;
      *at = Likeliest(*before, *after, 0.0).first;
      if (*at == 0 || *at == n_) return false;
      if (*at == was) break;
    }
    return true;
  }

  // Where the step may be: first and last flash at which it costs less than `more` extra.
  std::pair<std::size_t, std::size_t> Likeliest(double before, double after, double more) const {
    // loss(j) = sum before j with `before` + sum from j on with `after`
    double loss = Loss(0, n_, after), best = loss;
    std::vector<double> all = {loss};
    for (std::size_t j = 0; j < n_; ++j) {
      loss += LossOf(view_, in_, j, before) - LossOf(view_, in_, j, after);
      all.push_back(loss);
      best = std::min(best, loss);
    }
    std::size_t first = n_, last = 0;
    for (std::size_t j = 0; j <= n_; ++j) {
      if (all[j] > best + more) continue;
      first = std::min(first, j);
      last = j;
    }
    return {first, last};
  }

  // Offset at the middle and slope, by those flashes that are no outliers.
  bool Line(double* middle, double* offset, double* slope) {
    const double half = 0.5 * (view_.t.front() + view_.t.back());
    const std::size_t cut = static_cast<std::size_t>(
        std::lower_bound(view_.t.begin(), view_.t.end(), half) - view_.t.begin());
    if (cut < 2 || cut + 2 > n_ || !(view_.t.back() > view_.t.front())) return false;
    const double early = Level(0, cut), late = Level(cut, n_);
    *middle = half;
    *offset = 0.5 * (early + late);
    *slope = (late - early) / (0.5 * (view_.t.back() - view_.t.front()));
    for (int round = 0; round < kRounds; ++round) {
      double w = 0, wt = 0, wtt = 0, wr = 0, wtr = 0;
      for (std::size_t i = 0; i < n_; ++i) {
        const double t = view_.t[i] - half;
        if (!Good(i, *offset + *slope * t)) continue;
        w += in_.weight[i];
        wt += in_.weight[i] * t;
        wtt += in_.weight[i] * t * t;
        wr += in_.weight[i] * in_.r[i];
        wtr += in_.weight[i] * t * in_.r[i];
      }
      const double determinant = w * wtt - wt * wt;
      if (!(determinant > 0.0)) return false;
      // About the weighted middle, where offset and slope are independent.
      *slope = (w * wtr - wt * wr) / determinant;
      *offset = (wr - *slope * wt) / w;
    }
    return true;
  }

 private:
  bool Good(std::size_t i, double level) const {
    if (!(in_.weight[i] > 0.0)) return false;
    const double r = in_.r[i] - level;
    return view_.rest[i] + r * r * in_.weight[i] < in_.cap[i];
  }

  // The loss of a stretch about its median, from every so many flashes.
  double CoarseLoss(std::size_t first, std::size_t end) {
    constexpr std::size_t kMost = 200;  // flashes that it is taken from
    const std::size_t stride = std::max<std::size_t>(1, (end - first) / kMost);
    sorted_.clear();
    for (std::size_t i = first; i < end; i += stride) {
      if (in_.weight[i] > 0.0) sorted_.push_back(in_.r[i]);
    }
    if (sorted_.empty()) return 0.0;
    const double level = Median(sorted_);
    double sum = 0.0;
    for (std::size_t i = first; i < end; i += stride) sum += LossOf(view_, in_, i, level);
    return sum * static_cast<double>(stride);
  }

  const CameraView& view_;
  const Residuals& in_;
  std::size_t n_;
  std::vector<double> sorted_;
};

}  // namespace

Hypothesis BestOffset(const CameraView& view, const Residuals& in, double wild) {
  Hypothesis best;
  best.fault.camera = view.camera;
  best.gain = -HUGE_VAL;
  const std::size_t n = view.size();
  constexpr std::size_t kFewest = 8;  // flashes
  if (n < kFewest) return best;
  Offsets offsets(view, in);
  const double none = offsets.Loss(0, n, 0.0), price = std::log(static_cast<double>(n));
  // Whether it beats readings without a law, from flash `first` on.
  const auto is_law = [&](std::size_t first, double offset, double slope, double middle) {
    double sum = 0.0;
    for (std::size_t i = first; i < n; ++i) {
      const double loss = LossOf(view, in, i, offset + slope * (view.t[i] - middle));
      sum += OverNoLaw(in, i, loss, wild);
    }
    return sum > 0.0;
  };
  const double level = offsets.Level(0, n);
  if (is_law(0, level, 0.0, 0.0)) {
    best.gain = none - offsets.Loss(0, n, level) - price;
    best.fault.offset_px = level;
  }
  std::size_t at = 0;
  double before = 0.0, after = 0.0;
  if (offsets.Step(&at, &before, &after)) {
    // Two levels and a moment.
    const double gain = none - offsets.Loss(0, at, before) - offsets.Loss(at, n, after) - 3 * price;
    if (gain > best.gain && is_law(at, after, 0.0, 0.0)) {
      constexpr double kSure = 9.0;  // of -2 ln of the likelihood: three sigmas
      const auto [first, last] = offsets.Likeliest(before, after, kSure);
      best.gain = gain;
      best.before_px = before;
      best.fault.offset_px = after;
      best.fault.earliest = first == 0 ? view.t.front() : view.t[first - 1];
      best.fault.latest = view.t[std::min(last, n - 1)];
      best.fault.from = view.t[at];
    }
  }
  double middle = 0.0, offset = 0.0, slope = 0.0;
  if (!offsets.Line(&middle, &offset, &slope)) return best;
  double loss = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    loss += LossOf(view, in, i, offset + slope * (view.t[i] - middle));
  }
  const double gain = none - loss - 2 * price;
  if (gain <= best.gain || !is_law(0, offset, slope, middle)) return best;
  best = {};
  best.gain = gain;
  best.fault.kind = FaultKind::kDrifting;
  best.fault.camera = view.camera;
  best.fault.offset_px = offset;
  best.fault.slope = slope;
  best.fault.at = middle;
  return best;
}

}  // namespace unfurl::measure
