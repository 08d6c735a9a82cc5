// Widths of spots that jump: near its focus a camera's widths change with depth as steeply as they
// like, so that only what comes at once, with all marks, is told from motion.
#include <algorithm>
#include <cmath>

#include "base/statistics.h"
#include "measure/health_light.h"

namespace unfurl::measure {

namespace {

// A jump of the square of a width, by camera, mark and slice: what defocus adds to it. No weight
// where none is known.
struct Jump {
  double weight = 0.0;                             // [1/px^4]
  double level = 0.0, jump = 0.0, variance = 0.0;  // [px^2], [px^4]
};

struct Sum {
  double weight = 0.0, product = 0.0;
  double Gain() const { return weight > 0.0 ? product * product / weight : 0.0; }
  double Deviation() const { return weight > 0.0 ? product / std::sqrt(weight) : 0.0; }
};

class Widths {
 public:
  Widths(const std::vector<std::vector<LightLook>>& looks, int marks, int slices)
      : cameras_(static_cast<int>(looks.size())), marks_(marks), slices_(slices) {
    all_.resize(looks.size() * static_cast<std::size_t>(marks * slices));
    for (int c = 0; c < cameras_; ++c) {
      for (int m = 0; m < marks; ++m) {
        for (int k = 1; k < slices; ++k) {
          Jump& one = At(c, m, k);
          const LightSeries series(looks[static_cast<std::size_t>(c)], true, m, k - 1, k);
          if (!series.Jump(&one.level, &one.jump, &one.variance) || !(one.level > 0.0)) continue;
          one.weight = 1.0 / one.variance;
        }
      }
    }
  }

  // Without mark `but`.
  Sum Of(const LightSubject& subject, int slice, int but = -1) const {
    Sum sum;
    ForEach(subject, slice, [&](const Jump& one, int, int mark) {
      if (mark == but) return;
      sum.weight += one.weight;
      sum.product += one.weight * one.jump;
    });
    return sum;
  }
  // Of all cameras but one.
  Sum OfOthers(int camera, int slice) const {
    Sum sum;
    ForEach({LightKind::kAll, -1, -1}, slice, [&](const Jump& one, int of, int) {
      if (of == camera) return;
      sum.weight += one.weight;
      sum.product += one.weight * one.jump;
    });
    return sum;
  }

  // All in all, and its standard deviation, by the scatter among marks too.
  void Size(const LightSubject& subject, int slice, double* size, double* sigma) const {
    double level = 0.0, jump = 0.0, variance = 0.0, n = 0.0;
    ForEach(subject, slice, [&](const Jump& one, int, int) {
      if (!(one.weight > 0.0)) return;
      level += one.level;
      jump += one.jump;
      variance += one.variance;
      n += 1.0;
    });
    *size = level > 0.0 ? jump / level : 0.0;
    double scatter = 0.0;
    ForEach(subject, slice, [&](const Jump& one, int, int) {
      if (one.weight > 0.0) scatter += std::pow(one.jump - jump / n, 2);
    });
    if (n > 1.0) variance = std::max(variance, scatter * n / (n - 1.0));
    *sigma = level > 0.0 ? std::sqrt(variance) / level : HUGE_VAL;
  }

  // How much wider than their errors a camera's jumps scatter over the record, at least 1 [-].
  double Wide(const LightSubject& subject) const {
    std::vector<double> deviation;
    for (int k = 1; k < slices_; ++k) {
      const Sum sum = Of(subject, k);
      if (sum.weight > 0.0) deviation.push_back(sum.Deviation());
    }
    if (deviation.empty()) return 1.0;
    const double sigma = RobustSigma(deviation);
    return std::max(1.0, sigma * sigma);
  }

  int cameras() const { return cameras_; }
  int marks() const { return marks_; }
  int slices() const { return slices_; }

 private:
  Jump& At(int camera, int mark, int slice) {
    return all_[static_cast<std::size_t>((camera * marks_ + mark) * slices_ + slice)];
  }
  template <typename Do>
  void ForEach(const LightSubject& subject, int slice, const Do& take) const {
    for (int c = 0; c < cameras_; ++c) {
      if (subject.camera >= 0 && subject.camera != c) continue;
      for (int m = 0; m < marks_; ++m) {
        if (subject.mark >= 0 && subject.mark != m) continue;
        take(all_[static_cast<std::size_t>((c * marks_ + m) * slices_ + slice)], c, m);
      }
    }
  }

  int cameras_, marks_, slices_;
  std::vector<Jump> all_;
};

// One camera's jumps, the strongest first.
class FocusSearch {
 public:
  FocusSearch(const std::vector<std::vector<LightLook>>& looks, const Widths& widths,
              const LightClock& clock, const HealthOptions& options, int camera)
      : looks_(looks),
        widths_(widths),
        clock_(clock),
        options_(options),
        subject_{LightKind::kFocus, camera, -1},
        wide_(widths.Wide(subject_)),
        open_(static_cast<std::size_t>(clock.slices), 1) {
    const double tests = static_cast<double>(widths.cameras()) * clock.slices;
    limit_ = NormalQuantile(1.0 - 0.5 * options.false_alarm / tests);
  }

  // The strongest of those that are left; -1: none is beyond chance.
  int Next() {
    constexpr int kApart = 6;  // slices: a jump is seen in those around it, too
    int at = -1;
    double most = limit_ * limit_ * wide_;
    for (int k = 1; k < clock_.slices; ++k) {
      const double gain = widths_.Of(subject_, k).Gain();
      if (open_[static_cast<std::size_t>(k)] == 0 || gain <= most) continue;
      most = gain;
      at = k;
    }
    if (at < 0) return at;
    for (int k = std::max(0, at - kApart); k < std::min(clock_.slices, at + kApart + 1); ++k) {
      open_[static_cast<std::size_t>(k)] = 0;
    }
    return at;
  }

  // False: it is no fault of this camera.
  bool Judge(int at, LightFault* fault) const {
    *fault = {.subject = subject_};
    double square = 0.0, sigma = 0.0;
    widths_.Size(subject_, at, &square, &sigma);
    if (!(std::abs(square) > limit_ * sigma) || !(square > -1.0)) return false;
    // Of a width, from its square.
    fault->size = std::sqrt(1.0 + square) - 1.0;
    fault->sigma = 0.5 * sigma / (1.0 + fault->size);
    if (std::abs(fault->size) < options_.least_light) return false;
    const LightMoment moment{.subject = subject_,
                             .width = true,
                             .marks = widths_.marks(),
                             .first = at - 2,  // it may be next to where it shows most
                             .last = at + 1,
                             .size = std::log1p(square)};
    if (!FindMoment(looks_, moment, &fault->earliest, &fault->latest)) {
      fault->earliest = clock_.Edge(at - 2);
      fault->latest = clock_.Edge(at + 2);
    }
    fault->until = fault->latest;
    const double beyond = limit_ * limit_ * wide_;
    // One mark tells a camera from its LED by what other cameras see of it.
    if (widths_.marks() == 1) return !(widths_.OfOthers(subject_.camera, at).Gain() > beyond);
    // What leaves with one mark is that mark's.
    for (int m = 0; m < widths_.marks(); ++m) {
      if (!(widths_.Of(subject_, at, m).Gain() > beyond)) return false;
    }
    return true;
  }

 private:
  const std::vector<std::vector<LightLook>>& looks_;
  const Widths& widths_;
  const LightClock& clock_;
  const HealthOptions& options_;
  LightSubject subject_;
  double wide_ = 1.0, limit_ = 0.0;
  std::vector<char> open_;  // slices
};

}  // namespace

void FindFocusFaults(const std::vector<std::vector<LightLook>>& looks, int marks,
                     const LightClock& clock, const HealthOptions& options,
                     std::vector<LightFault>* faults) {
  const Widths widths(looks, marks, clock.slices);
  for (int camera = 0; camera < widths.cameras(); ++camera) {
    FocusSearch search(looks, widths, clock, options, camera);
    LightFault fault;
    for (int at = search.Next(); at >= 0; at = search.Next()) {
      if (search.Judge(at, &fault)) faults->push_back(fault);
    }
  }
}

}  // namespace unfurl::measure
