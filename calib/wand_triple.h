#pragma once

#include <Eigen/Core>
#include <vector>

#include "base/random.h"

namespace unfurl::calib {

/// Three pinholes and a bar: u = (a . p + alpha) / (1 + b . p) for each camera, readings less the
/// row's middle and over the row, lengths over the bar's.
struct TriplePinholes {
  Eigen::Matrix<double, 7, 3> x;  // by camera: a, alpha, b
  double misfit = 0.0;            // median of |length - 1| of the bars found with them [-]
  double cost = 0.0;              // of the search, robust; what starts are compared by [-]

  // Where three planes meet; false where they do not, or behind a camera.
  bool Find(const Eigen::Vector3d& u, Eigen::Vector3d* p) const;
};

/// Readings of the bar's two ends by three cameras in n poses, 3 x n, less the rows' middle and
/// over the row [-].
struct BarReadings {
  Eigen::Matrix3Xd from, to;
};

// The distinct ends of `starts` + 1 searches, most probable first, `most` at most, but for
// those that put the bars where one that was `tried` does; n >= 6. Readings of three cameras say
// nothing of their views but through the bar's length: n equations for 15 unknowns.
std::vector<TriplePinholes> FitTriple(const BarReadings& bars, int starts, int most,
                                      const std::vector<TriplePinholes>& tried, Rng rng);

}  // namespace unfurl::calib
