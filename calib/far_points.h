#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/explain.h"
#include "calib/observations.h"
#include "data/rig.h"

namespace unfurl::calib {

// A slip of metres in a survey of tenths of a millimetre: no loss tells it from two readings that
// are wrong, and a lens model folds so far outside the field. So points that lie far outside of all
// others are first left out with their readings, and judged by where the rig of the rest finds
// them.

/// Points farther from the middle (medians) than four times the median distance; none where more
/// than a tenth are, as then the survey is spread so.
std::vector<int> FarPoints(const Eigen::Matrix3Xd& p);

/// The survey as if no camera had seen those points, which lie in its middle.
Observations Unseen(Observations data, const std::vector<int>& points);

/// Where a rig finds a point that took no part in its calibration.
struct FarPoint {
  int point = 0;
  bool found = false;                            ///< its readings meet in one place
  bool right = false;                            ///< and that is where it was surveyed
  Eigen::Vector3d at = Eigen::Vector3d::Zero();  ///< the place [m]
};
/// Of each of `points`, by its readings; `rig` is that of the others.
std::vector<FarPoint> FindFarPoints(const Observations& data, const std::vector<int>& points,
                                    const data::Rig& rig);

/// In words: which coordinate is off, and by how much.
GrossFinding Finding(const Observations& data, const FarPoint& far);

}  // namespace unfurl::calib
