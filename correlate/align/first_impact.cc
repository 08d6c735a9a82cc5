#include "correlate/align/first_impact.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "base/statistics.h"

namespace unfurl::correlate {

double FirstImpact(const Observations& observations) {
  constexpr double kFar = 6.0;         // times what noise and smooth motion explain
  constexpr std::size_t kWindow = 6;   // samples of a straight line before, and of one after
  constexpr std::size_t kBefore = 20;  // samples that tell how the motion changes by itself
  double first = std::numeric_limits<double>::infinity();
  for (const MarkSeries& mark : observations.marks) {
    if (mark.size() < 3 * kWindow + kBefore) continue;
    // Velocity by a straight line through samples [from, from + kWindow).
    auto velocity = [&](std::size_t from) {
      double middle = 0.0, spread = 0.0;
      for (std::size_t i = from; i < from + kWindow; ++i) middle += mark.t[i] / kWindow;
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (std::size_t i = from; i < from + kWindow; ++i) {
        sum += (mark.t[i] - middle) * mark.p.col(static_cast<Eigen::Index>(i));
        spread += (mark.t[i] - middle) * (mark.t[i] - middle);
      }
      return std::make_pair(Eigen::Vector3d(sum / spread), 1.0 / std::sqrt(spread));
    };
    // What velocity changes by at sample i, less what it changed by a window before: acceleration
    // drops out.
    std::vector<double> jump;
    const std::size_t from = 2 * kWindow, to = mark.size() - kWindow;
    auto at = [&](std::size_t i) {
      return Eigen::Vector3d(velocity(i).first - 2.0 * velocity(i - kWindow).first +
                             velocity(i - 2 * kWindow).first)
          .norm();
    };
    for (std::size_t i = from; i < to; ++i) {
      jump.push_back(at(i));
      if (jump.size() <= kBefore) continue;
      const auto c = static_cast<Eigen::Index>(i);
      const double sigma = std::sqrt((mark.cov(0, c) + mark.cov(3, c) + mark.cov(5, c)) / 3.0);
      const double noise = sigma * std::sqrt(6.0) * velocity(i).second;
      const double usual = Median(std::span(jump).subspan(jump.size() - 1 - kBefore, kBefore));
      if (jump.back() <= kFar * (noise + usual)) continue;
      // The window after sees it first; it is largest where the windows meet there.
      std::size_t peak = i;
      double largest = jump.back();
      for (std::size_t k = i + 1; k < std::min(i + kWindow, to); ++k) {
        const double here = at(k);
        if (here > largest) largest = here, peak = k;
      }
      first = std::min(first, mark.t[peak]);
      break;
    }
  }
  return std::isfinite(first) ? first : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace unfurl::correlate
