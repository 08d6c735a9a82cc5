#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "measure/health.h"

namespace unfurl::measure {

// What the others tell of one camera, flash by flash: of every flash that three others saw, where
// they put the mark, and what this camera should read of it.
struct CameraView {
  int camera = 0;
  std::vector<std::size_t> line;  // of the evidence
  std::vector<double> t;          // [s]
  std::vector<double> predicted;  // [px]
  std::vector<double> variance;   // of that, by the others' readings [px^2]
  std::vector<double> rest;       // chi-square of the others, which the camera cannot help [-]
  std::size_t size() const { return line.size(); }
};
CameraView ViewOf(const HealthEvidence& evidence, const Triangulator& triangulator, int camera,
                  std::size_t marks);

// Its readings less the predicted ones, of a camera that is late by some lines. Where it has no
// reading, `weight` is 0.
struct Residuals {
  std::vector<double> r;       // [px]
  std::vector<double> weight;  // inverse variance [1/px^2]
  std::vector<double> cap;     // the loss of a reading that is wrong by itself [-]
};
Residuals ResidualsOf(const HealthEvidence& evidence, const Triangulator& triangulator,
                      const CameraView& view, int lag, double wild);

// Loss of flash i with an offset taken off: chi-square, or the price of a wrong reading.
inline double LossOf(const CameraView& view, const Residuals& in, std::size_t i, double offset) {
  if (!(in.weight[i] > 0.0)) return 1.0;  // what is expected of a good one
  const double r = in.r[i] - offset;
  return std::min(view.rest[i] + r * r * in.weight[i], in.cap[i]);
}

// What flash i would cost less if all of this camera's readings were wrong and followed no law,
// over its loss `by` some law. A law that gains less than that, from when it begins on, fits some
// flashes by chance: it explains nothing.
inline double OverNoLaw(const Residuals& in, std::size_t i, double by, double wild) {
  if (!(in.weight[i] > 0.0)) return 0.0;
  return in.cap[i] - 2.0 * std::log((1.0 - wild) / wild) - by;
}

// A fault that may explain a view's residuals, and what the loss is less by: of errors that are
// white, as if the rig were known exactly.
struct Hypothesis {
  Fault fault;
  double before_px = 0.0;  // of a move: the offset before it [px]
  double gain = 0.0;       // [-]
};

// The likeliest of: off from the beginning, a step, a drift, that beats readings without a law;
// else its gain is -infinity.
Hypothesis BestOffset(const CameraView& view, const Residuals& residuals, double wild);
// The likeliest lag, of those of `by_lag` (-most .. most; by_lag[most] is none), where it is beyond
// chance for all `cameras`; else its gain is -infinity.
Hypothesis BestLag(const CameraView& view, std::span<const Residuals> by_lag,
                   const HealthOptions& options, std::size_t cameras);

// From how many of its sigmas on an offset of any camera, at any moment, is beyond chance [-].
double SigmasOfAnOffset(const HealthOptions& options, std::size_t cameras);

// All cameras and the calibration's errors at once. `likeliest` says which readings are wrong by
// themselves, and when a step was; the best camera and shape, its suspects; or nothing that is
// beyond chance: false.
bool JudgeOffsets(const HealthEvidence& evidence, const Triangulator& triangulator,
                  const Hypothesis& likeliest, const HealthOptions& options, std::size_t marks,
                  Fault* fault);

}  // namespace unfurl::measure
