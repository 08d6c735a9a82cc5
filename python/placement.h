#pragma once

#include <pybind11/pybind11.h>

#include "correlate/placement.h"

namespace unfurl::python {

/// What is known of a record's clock and frame, as Python says it. offset, drift: None (nothing is
/// said), "free", "known" (it is 0), a number, (mean, sigma). frame: None, "free", "known",
/// (shift, rotation) standard deviations in m and rad. Throws Error for anything else.
correlate::Placement PlacementFrom(const pybind11::object& offset, const pybind11::object& drift,
                                   const pybind11::object& frame);

}  // namespace unfurl::python
