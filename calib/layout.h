#pragma once

#include <string>
#include <vector>

#include "calib/unit_slip.h"
#include "data/lab.h"
#include "data/rig.h"

namespace unfurl::calib {

// How the cameras that a calibration found stand against where they were meant to stand. Readings
// cannot tell a world from its mirror image (a mirrored camera reads alike); a layout can, and with
// it a survey in the left-handed order N, E, H is found out.
struct LayoutMatch {
  // Of places, and of points along the optical axes as far away as the cameras are from their
  // middle, after a rigid fit [m].
  double rms = 0.0;
  double rms_mirrored = 0.0;  // the same of the mirrored rig
  bool mirrored = false;
};
// Throws Error when a camera of the rig is not in the lab.
LayoutMatch CompareLayout(const data::Rig& rig, const data::Lab& lab);

// What would bring the rig to the layout, to half of the distance at most, that is not: another
// unit; the mirror image; two cameras exchanged, or all moved on; these two at once. Cameras that
// stand in a symmetry leave several, which are all told; the first fits best.
struct LayoutSlip {
  std::string what;    // "the survey is left-handed"
  std::string remedy;  // what to write instead
  double rms = 0.0;    // after it, as LayoutMatch::rms [m]
  int parts = 0;       // things that are wrong at once
  bool mirrored = false;
};
// The mirror image is no slip of a bar's readings, whose frame the layout gives.
std::vector<LayoutSlip> FindLayoutSlips(const data::Rig& rig, const data::Lab& lab,
                                        ScaleFrom from = ScaleFrom::kSurvey);

// The cameras' distances against the layout's, to its mounting errors (`lab.mounting.position`) and
// the rig's covariance: what the length of a bar, or a survey's scale, makes of them and no reading
// shows. 1 + strain is what the found places had to be multiplied by.
struct LayoutScale {
  double strain = 0.0, sigma = 0.0;  // [-]
  bool off = false;                  // beyond chance (0.1%); never where the layout states no error
};
LayoutScale CompareScale(const data::Rig& rig, const data::Lab& lab);
// Says so, and "usable with care" at best, where it is off.
void JudgeScale(const data::Lab& lab, ScaleFrom from, data::Rig* rig);

// Stores the match among the rig's checks; "do not use" where a slip explains how the cameras
// stand; else the scale.
void JudgeLayout(const data::Lab& lab, data::Rig* rig, ScaleFrom from = ScaleFrom::kSurvey);

}  // namespace unfurl::calib
