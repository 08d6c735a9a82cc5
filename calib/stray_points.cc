#include "calib/stray_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/error.h"
#include "base/length.h"
#include "base/statistics.h"

namespace unfurl::calib {

namespace {

// The others' extent: a camera that sees all of them from as near as it is wide sees no further.
constexpr double kStrayExtents = 3.0;
constexpr std::size_t kStrayFewest = 4;  // others that show how far a survey reaches

// Along the axis where it is largest: squares of 1e200 m are no numbers.
double Apart(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return (a - b).lpNorm<Eigen::Infinity>();
}

}  // namespace

void RefuseStray(const Observations& data, const std::string& where) {
  const auto n = static_cast<std::size_t>(data.points());
  if (n <= kStrayFewest) return;
  Eigen::Vector3d middle;
  for (Eigen::Index k = 0; k < 3; ++k) {
    const std::vector<double> row(data.p.row(k).begin(), data.p.row(k).end());
    middle(k) = Median(row);
  }
  const auto at = [&](std::size_t i) { return data.p.col(static_cast<Eigen::Index>(i)); };
  // From outside in: only those at the outside can be strays.
  std::vector<std::size_t> order(n);
  for (std::size_t i = 0; i < n; ++i) order[i] = i;
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return Apart(at(a), middle) > Apart(at(b), middle);
  });
  std::string stray;
  double far = 0.0, extent = 0.0;
  for (std::size_t first = 0; first + kStrayFewest < n; ++first) {
    const Eigen::Vector3d p = at(order[first]);
    Eigen::Vector3d low = at(order[first + 1]), high = low;
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t k = first + 1; k < n; ++k) {
      low = low.cwiseMin(at(order[k]));
      high = high.cwiseMax(at(order[k]));
      nearest = std::min(nearest, Apart(p, at(order[k])));
    }
    const double extent_here = (high - low).maxCoeff();
    if (!(nearest > kStrayExtents * extent_here)) break;
    if (!stray.empty()) stray += "\", \"";
    stray += data.ids[order[first]];
    far = nearest;
    extent = extent_here;
  }
  if (stray.empty()) return;
  throw Error(fmt::format("point \"{}\" lies {:.3g} m or more from all others, which lie within {}",
                          stray, far, LengthText(extent)),
              where, "correct its coordinates and their unit, or leave its row out");
}

}  // namespace unfurl::calib
