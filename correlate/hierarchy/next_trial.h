#pragma once

#include <string>
#include <vector>

#include "correlate/fit/parameter.h"
#include "correlate/hierarchy/hierarchy.h"
#include "correlate/model.h"

namespace unfurl::correlate {

/// The marks of the next trial, with what scatter and errors leave open.
struct NextTrial {
  std::string failure;  ///< why there is none; empty: there is
  /// By mark, 3 x n: the model at the parameters' means, and the ends of the 95% intervals of each
  /// coordinate by itself [m].
  std::vector<Eigen::Matrix3Xd> middle, low, high;
  /// How far the marks are from linear in the parameters over the scatter: RMS of the bend, of the
  /// parameter that bends them most, over RMS of the intervals' halves [-].
  double bend = 0.0;
};

/// Linear about the means, by central differences over the width of each parameter's own interval:
/// each coordinate at each time is a combination of the parameters, and as such a random effect by
/// itself. Runs the model 2 p + 1 times.
/// `sample_sigma`: of a sample's own error, where samples are
/// wanted and not the motion [m].
NextTrial PredictNext(const Model& model, const std::vector<Parameter>& parameters,
                      const Hierarchy& hierarchy, const Stamps& stamps, double sample_sigma = 0.0);

}  // namespace unfurl::correlate
