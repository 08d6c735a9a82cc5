#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/wand_data.h"
#include "calib/wand_fit.h"

namespace unfurl::calib {

// Where the bar was in each pose, from marks that were found (3 x (n m), NaN: not found) and, where
// only one mark was, by trying directions; poses of fewer than 5 readings, or of no found mark, are
// taken out of `data`. How many were.
int StartPoses(const std::vector<data::RigCamera>& cameras, const std::vector<double>& sigma_px,
               const Eigen::Matrix3Xd& marks, WandData* data, WandState* state);

// Velocities from neighbouring poses and the unrest from how these change; none where the marks
// flash at once.
void StartMotion(WandFit* fit);

// The survey's frame, where three points or more that are not on one line are found: the rig, or
// its mirror image where that fits better, is moved there.
void TakeFrame(WandFit* fit);

// A surveyed place's squared distance from the fit's, in its covariance [-].
double SurveySquare(const Observations& points, const WandState& state, int point);

}  // namespace unfurl::calib
