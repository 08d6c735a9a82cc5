#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "correlate/compare/comparison.h"
#include "correlate/fit/fit.h"
#include "data/fit.h"
#include "data/study.h"
#include "python/bindings.h"
#include "study/fit_study.h"

namespace unfurl::python {

/// A fit as Python has it.
struct Fit : Recorded<data::FitRecord> {
  std::shared_ptr<correlate::Comparison> comparison;  // of a study, at the estimate
};

/// Of a study, with the files that it was made from; `compare`: with the comparison, if usable.
Fit FitOf(study::StudyFit fitted, bool compare = false);

/// The object as it is, or read from the path that was given in its place, keys changed by `set`.
data::Study StudyFrom(const py::object& study_or_path, const py::object& set);

/// ProgressOf for fits.
std::function<void(const correlate::FitProgress&)> FitProgressOf(const py::object& progress,
                                                                 CallbackError* errors);

}  // namespace unfurl::python
