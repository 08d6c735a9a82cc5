#pragma once

#include <limits>

namespace unfurl::measure {

/// What is done to the readings of one camera in a stretch of a trial.
struct Correction {
  int camera = -1;  ///< -1: of all, whose samples lose their positions: nobody knows which is wrong
  double from = -std::numeric_limits<double>::infinity();  ///< [s]
  double to = std::numeric_limits<double>::infinity();     ///< [s]
  double offset_px = 0.0;    ///< taken off its readings at time `at` [px]
  double slope = 0.0;        ///< of what is taken off [px/s]
  double at = 0.0;           ///< [s]
  double sigma_px = 0.0;     ///< of the offset: an error that all samples share [px]
  double slope_sigma = 0.0;  ///< of the slope, likewise and independent of it [px/s]
  int lag = 0;               ///< its lines are taken so many later
  bool leave_out = false;    ///< its readings are not used
  double widen = 1.0;        ///< of the stated sigmas of its readings of `mark` [-]
  int mark = -1;             ///< -1: `widen` is of marks that have none of their own

  bool Holds(double t) const { return t >= from && t < to; }              ///< at [s]
  double Offset(double t) const { return offset_px + slope * (t - at); }  ///< at t [s], [px]
};

}  // namespace unfurl::measure
