#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "correlate/model.h"
#include "correlate/observations.h"
#include "correlate/tolerance.h"

namespace unfurl::correlate {

// How tightly a simulator has to run for a fit to these data: differences of its answers are the
// fit's slopes, and after many impacts its own scatter is what they drown in.
struct ToleranceChoice {
  double rtol = kLoosestTolerance;  // [-]
  double noise = 0.0;   // what ten times tighter moves the data by there, RMS in sigmas [-]
  double wanted = 0.0;  // the scatter that it had to stay below, likewise [-]
  double of_data = 0.0;  // of that, what the data alone allow [-]
  double sigma = 0.0;   // of the marks; 0: there are none [m]
};

// The loosest of 1e-5, 1e-6 .. 1e-10 whose scatter at `theta` over the whole record can move no
// estimate by more than a fifth of its standard error (of the data: over n rows, 0.2/sqrt(n) sigmas
// RMS; 0.01 where they are few, since it is seen at one point alone), or is below a hundredth of what the mesh leaves, `part` of what `finer` (null: none) moves
// the data by. Where none is, the one of least scatter. `at(rtol)` makes the model.
ToleranceChoice ChooseTolerance(const std::function<std::shared_ptr<Model>(double rtol)>& at,
                                const Model* finer, const std::vector<double>& theta,
                                const Observations& observations, double part = 1.0);

}  // namespace unfurl::correlate
