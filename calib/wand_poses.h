#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "base/pose.h"
#include "calib/wand_data.h"
#include "calib/wand_fit.h"
#include "calib/wand_guess.h"

namespace unfurl::calib {

// Poses that a fit cannot begin with, by number.
struct PosesLeft {
  std::vector<int> unseen;         // fewer than 5 readings, or than 3 of each mark
  std::vector<int> contradicting;  // read well enough, but no mark is found from the readings
};

// Where the bar was in each pose, from marks that were found (3 x (n m), NaN: not found) and, where
// only one mark was, by trying directions: some all around, and those to the rough places of the
// others. Those all around are too far apart for a lens that fits ill at the ends of the rows: of
// seven readings two agree with a wrong one, and the robust loss stays with them. The poses of
// which nothing can be said are taken out of `data`.
PosesLeft StartPoses(const std::vector<data::RigCamera>& cameras,
                     const std::vector<double>& sigma_px, const Eigen::Matrix3Xd& marks,
                     const std::vector<RoughMark>& rough, WandData* data, WandState* state);

// Velocities from neighbouring poses and the unrest from how these change; none where the marks
// flash at once.
void StartMotion(WandFit* fit);

// Whether places (by column) fix a frame: three or more that are not on one line.
bool FixFrame(const Eigen::Matrix3Xd& p);

// Whether the mirror image is taken, which fits places nearer: not against what is known of the
// hand already, unless the other misses them by so much more that it is beyond doubt; then
// `handed`, too.
bool TakesMirror(const RigidFit& plain, const RigidFit& mirror, bool* handed);

// The survey's frame, where three points or more that are not on one line are found: the rig, or
// its mirror image where that fits better, is moved there. Throws Error where they are in another
// unit of length than the bar.
void TakeFrame(const std::string& where, WandFit* fit);

// A surveyed place's squared distance from the fit's, in its covariance [-].
double SurveySquare(const Observations& points, const WandState& state, int point);

// The fit's poses `keep` (ascending), with what they were left at; summary and system are those of
// all poses until the next bundle.
WandFit KeepPoses(const WandFit& fit, const std::vector<int>& keep);

}  // namespace unfurl::calib
