#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "correlate/compare/comparison.h"
#include "correlate/fit/fit.h"
#include "data/fit.h"
#include "python/bindings.h"

namespace unfurl::python {

/// A fit as Python has it.
struct Fit : Recorded<data::FitRecord> {
  std::shared_ptr<correlate::Comparison> comparison;  // of a study, at the estimate
};

/// ProgressOf for fits.
std::function<void(const correlate::FitProgress&)> FitProgressOf(const py::object& progress,
                                                                 CallbackError* errors);

}  // namespace unfurl::python
