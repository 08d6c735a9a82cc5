#include "correlate/fit/at_once.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "base/statistics.h"

namespace unfurl::correlate {

namespace {

// As far as clocks move from one solution to the next (Channel's margin) [samples].
constexpr std::ptrdiff_t kWithin = 16;

// When the model does what it does, by the residuals.
class Timing {
 public:
  // `noise`: of a residual, as it differs from its neighbours'.
  Timing(const Eigen::VectorXd& model, const Eigen::VectorXd& residual, double noise)
      : noise_(noise), model_(model), residual_(residual) {}

  // By how many samples the model may do early or late what it does at i, by the residuals to
  // either side: an event that is late takes with it all that follows. 1 at most, and where they
  // cannot tell.
  double LateBy(std::ptrdiff_t i) const {
    const std::optional<double> before = Side(i, -1), after = Side(i, 1);
    if (!before && !after) return 1.0;
    return std::min(1.0, std::max(before.value_or(0.0), after.value_or(0.0)));
  }

 private:
  struct Sample {
    double slope, left;  // what a shift by a sample does, and what of the residual is left
  };

  // A record's end tells nothing.
  std::optional<double> Side(std::ptrdiff_t i, int side) const {
    constexpr std::size_t kFewest = 8;  // samples; of fewer a median vouches for little
    // In medians of their size: steeper ones are what is done at once, and lie off if it is late.
    constexpr double kSteep = 3.0;
    std::vector<double> steep;
    std::vector<Sample> about;
    for (std::ptrdiff_t d = 1; d <= kWithin; ++d) {
      const std::ptrdiff_t k = i + side * d;
      if (k < 1 || k + 1 >= model_.size()) break;
      about.push_back({0.5 * (model_(k + 1) - model_(k - 1)), residual_(k)});
      steep.push_back(std::abs(about.back().slope));
    }
    if (about.size() < kFewest) return {};
    const double steepest = kSteep * Median(steep);
    std::erase_if(about, [&](const Sample& s) { return std::abs(s.slope) > steepest; });
    return steepest > 0.0 ? Shift(std::move(about)) : 1.0;  // at rest nothing is late
  }

  // The most that is not ruled out, by Huber's regression of residuals on slopes.
  double Shift(std::vector<Sample> samples) const {
    constexpr double kSure = 3.0;         // standard errors
    constexpr double kOfMedian = 0.6745;  // median of a normal deviate's size
    constexpr double kClip = 1.345;       // scales; Huber's, 95% efficient
    constexpr int kRounds = 5;            // each halves what is left, and more
    double squares = 0.0, shift = 0.0, scale = 0.0;
    for (const Sample& s : samples) squares += s.slope * s.slope;
    for (int round = 0; round <= kRounds; ++round) {
      std::vector<double> size;
      size.reserve(samples.size());
      for (const Sample& s : samples) size.push_back(std::abs(s.left));
      scale = Median(size) / kOfMedian;
      if (round == kRounds) break;
      double by = 0.0;
      for (const Sample& s : samples)
        by += s.slope * std::clamp(s.left, -kClip * scale, kClip * scale) / squares;
      for (Sample& s : samples) s.left -= by * s.slope;
      shift += by;
    }
    // Residuals beyond the noise are smooth, and as many fewer of them are independent.
    const double smooth = noise_ > 0.0 ? std::max(1.0, scale / noise_) : 1.0;
    return std::abs(shift) + kSure * scale * smooth / std::sqrt(squares);
  }

  double noise_;
  const Eigen::VectorXd& model_;
  const Eigen::VectorXd& residual_;
};

// What a model does at once, and what that excuses.
class AtOnce {
 public:
  explicit AtOnce(const Eigen::VectorXd& model) : model_(model), n_(model.size()) {
    for (std::ptrdiff_t i = 0; i < n_; ++i) {
      const auto [down, up] = ByAShift(i);
      down_.push_back(down), up_.push_back(up);
      off_.push_back(std::max(-down, up));
    }
    // Of what a shift does to a motion at rate alone half lies beyond the median; beyond five of
    // it lies what the model does at once. Below a sigma nothing shows.
    constexpr double kSharp = 5.0;
    sharp_ = std::max(1.0, kSharp * Median(off_));
  }

  // Of sample i [sigmas]; 0: nothing.
  double At(std::ptrdiff_t i) const {
    const double off = off_[static_cast<std::size_t>(i)];
    return off > sharp_ ? kHeights * off : 0.0;
  }

  // What lies between two samples is sharper than both: however little late it is, a reading may
  // be that of the other side, and nothing else.
  double Beside(std::ptrdiff_t i, double residual) const {
    const auto at = static_cast<std::size_t>(i);
    if (!(off_[at] > sharp_)) return 0.0;
    return kHeights * std::min(std::max(0.0, residual < 0.0 ? -down_[at] : up_[at]), Unforetold(i));
  }

 private:
  // A peak a sample off leaves its height at either place; twice that, as peaks lie between
  // samples.
  static constexpr double kHeights = 2.0;

  // What a shift by a sample, early or late, does here beyond what it does beside: down and up.
  std::pair<double, double> ByAShift(std::ptrdiff_t i) const {
    constexpr std::ptrdiff_t kBeside = 3;  // as of the median of gross readings
    std::pair<double, double> out{0.0, 0.0};
    if (i < 1 || i + 1 >= n_) return out;
    for (const std::ptrdiff_t by : {-1, 1}) {
      std::vector<double> beside;
      // In pairs: the slopes to one side alone are others than here wherever the motion bends.
      for (std::ptrdiff_t d = 1; d <= kBeside; ++d) {
        if (std::min(i - d, i - d + by) < 0 || std::max(i + d, i + d + by) >= n_) break;
        for (const std::ptrdiff_t k : {i - d, i + d}) beside.push_back(model_(k + by) - model_(k));
      }
      if (beside.empty()) continue;
      const double here = model_(i + by) - model_(i) - Median(beside);
      out = {std::min(out.first, here), std::max(out.second, here)};
    }
    return out;
  }

  // What a quintic through the three samples to either side does not foretell, twice: of a jump it
  // foretells half. All, where a record ends.
  double Unforetold(std::ptrdiff_t i) const {
    if (i < 3 || i + 3 >= n_) return std::numeric_limits<double>::infinity();
    const double near = model_(i - 1) + model_(i + 1), next = model_(i - 2) + model_(i + 2);
    const double foretold = (15.0 * near - 6.0 * next + model_(i - 3) + model_(i + 3)) / 20.0;
    return 2.0 * std::abs(model_(i) - foretold);
  }

  const Eigen::VectorXd& model_;
  std::ptrdiff_t n_;
  std::vector<double> down_, up_, off_;
  double sharp_ = 0.0;
};

}  // namespace

std::vector<double> ExcusedAtOnce(const Eigen::VectorXd& model, const Eigen::VectorXd& residual,
                                  double noise) {
  const AtOnce at_once(model);
  const Timing timing(model, residual, noise);
  const std::ptrdiff_t n = model.size();
  std::vector<double> out(static_cast<std::size_t>(n), 0.0);
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    double& own = out[static_cast<std::size_t>(i)];
    own = std::max(own, at_once.Beside(i, residual(i)));
    if (!(at_once.At(i) > 0.0)) continue;
    const double excused = at_once.At(i) * timing.LateBy(i);
    for (std::ptrdiff_t k = std::max<std::ptrdiff_t>(0, i - kWithin);
         k < std::min(n, i + kWithin + 1); ++k) {
      double& most = out[static_cast<std::size_t>(k)];
      most = std::max(most, excused);
    }
  }
  return out;
}

}  // namespace unfurl::correlate
