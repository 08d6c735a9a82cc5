#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "calib/check.h"
#include "calib/observations.h"
#include "data/rig.h"
#include "measure/triangulate.h"

namespace unfurl::calib {

// Points found from their readings, with the calibration's factor.
struct Found {
  measure::PointSolution solution;
  Eigen::Matrix3Xd F;
};

// What finds them: readings must contradict each other beyond doubt before a point is given up.
measure::Triangulator CheckTriangulator(const data::Rig& rig);

// Of each point of the survey. `match`: by camera of the data, the rig's.
std::vector<Found> FindPoints(const measure::Triangulator& triangulator, const Observations& data,
                              const std::vector<std::size_t>& match);

// The survey with points that lie far from where their readings meet brought nearer on the way
// there, so that readings are linear in what they are off by; all as they are where that is most of
// them, as then it is their frame that is another.
Observations Nearer(const data::Rig& rig, Observations data, const std::vector<Found>& found,
                    const std::vector<CheckedPoint>& checked);

}  // namespace unfurl::calib
