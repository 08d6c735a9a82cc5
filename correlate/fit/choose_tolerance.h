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
  double sigma = 0.0;   // of the marks; 0: there are none [m]
};

// The loosest of 1e-5, 1e-6 .. 1e-10 whose scatter at `theta` over the whole record is below a
// hundredth of what the residuals will be: the sigma of the data, and with it `part` of what
// `finer` (null: none) moves them by. Where none is, the one of least scatter. `at(rtol)` makes the
// model.
ToleranceChoice ChooseTolerance(const std::function<std::shared_ptr<Model>(double rtol)>& at,
                                const Model* finer, const std::vector<double>& theta,
                                const Observations& observations, double part = 1.0);

}  // namespace unfurl::correlate
