#pragma once

#include <Eigen/Core>
#include <string>

#include "calib/calibrate.h"

namespace unfurl::calib {

// Surveys may be in a grid whose origin is far away: kilometres, of which a room's tenths of a
// millimetre are 1e-11. A bundle that ends where its unknowns change by a small part of themselves
// would end early. So points that are farther from the origin than this many of their spreads are
// taken about a place of their own. Ordinary rooms keep their numbers, to the bit.
inline constexpr double kFarFromOrigin = 30.0;  // [-]

/// Where a survey is to be calibrated: zero, or a place near its points, a multiple of a power of
/// two, so that nothing is rounded on the way there and back [m].
Eigen::Vector3d NearOrigin(const Eigen::Matrix3Xd& p);

/// Medians of the coordinates: where most points are, whatever the blunders among them.
Eigen::Vector3d MiddleOf(const Eigen::Matrix3Xd& p);

/// Median distance of points from there [m].
double UsualDistance(const Eigen::Matrix3Xd& p, const Eigen::Vector3d& middle);

/// FitRig and Calibrate (calib/calibrate.h) about the origin as it is; private to the room.
RigFit FitHere(const Observations& data, const CalibrateOptions& options, const std::string& where);
Calibration CalibrateHere(const Observations& data, const CalibrateOptions& options,
                          const std::string& where);

}  // namespace unfurl::calib
