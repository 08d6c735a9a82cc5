#pragma once

#include <vector>

#include "calib/calibrate.h"
#include "calib/observations.h"
#include "calib/tally.h"
#include "calib/verdict_options.h"
#include "data/rig.h"

namespace unfurl::calib {

/// Sums over the held-out points: measured, predicted and the survey's squared errors.
struct HeldOutSums {
  double n = 0.0;
  double squares = 0.0, predicted = 0.0, survey = 0.0;  // [m^2]
  double nees = 0.0;                                    // squared errors over their covariance [-]
  double variance = 0.0;           // of `squares`, if the prediction is true [m^4]
  std::vector<double> sizes, own;  // |error|, and predicted without the survey's part [m]
};
HeldOutSums SumHeldOut(const CalibrationReport& report, const Observations& data);

/// Whether held-out points lie as far off as is predicted, all together and each: the fit may
/// follow a single wrong one where no others are near, and only without it does that show.
void JudgeHeldOut(const CalibrationReport& report, const HeldOutSums& sums,
                  const VerdictOptions& options, data::Rig* rig, Tally* tally);

}  // namespace unfurl::calib
