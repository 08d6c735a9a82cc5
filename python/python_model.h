#pragma once

#include <memory>
#include <string>
#include <vector>

#include "correlate/model.h"
#include "python/bindings.h"

namespace unfurl::python {

/// A Python function as the model of a fit, its parameters by `names`. unfurl.ModelFailed is a
/// failed evaluation; any other exception goes to `errors` and ends the fit.
std::unique_ptr<correlate::Model> ModelFrom(const py::object& function,
                                            const std::vector<std::string>& names,
                                            CallbackError* errors);

/// The exception unfurl.ModelFailed; before any model is evaluated.
void BindModelFailed(py::module_& m);

}  // namespace unfurl::python
