#pragma once

#include <utility>
#include <vector>

#include "calib/wand_bundle.h"
#include "calib/wand_data.h"

namespace unfurl::calib {

/// What a row of the whitened derivatives belongs to.
struct WandRow {
  enum Kind { kPrior, kReading, kPointReading, kSurvey, kMotion } kind = kPrior;
  int index = 0;  // of the reading, point or pose
};

/// Whitened derivatives, sparse by rows: columns of the cameras, places and common errors first
/// (`shared`), then of each pose, then of each point, in the solver's units.
struct WandRows {
  std::vector<WandRow> row;
  std::vector<double> residual;
  std::vector<int> first, column;  // of each row (and one more) in `value`; of each value
  std::vector<double> value;
  int cameras = 0, poses = 0, points = 0;
  int pose_size = 0;  // columns of a pose
  // By shared column: the unknown it is, in the order of WandSystem, and its unit.
  std::vector<std::pair<int, double>> shared;
  std::vector<int> fixed;  // unknowns without a column: terms that are held
  int size = 0;            // of all unknowns of WandSystem
  double length = 1.0;     // the solver's unit [m]
};

// Normal equations, poses and points eliminated; covariance and redundancies.
WandSystem SystemOf(const WandRows& rows, const WandData& data, const WandState& state);

}  // namespace unfurl::calib
