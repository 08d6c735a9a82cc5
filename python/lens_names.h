#pragma once

#include <string>

#include "data/lens.h"

namespace unfurl::python {

/// A lens model, and a set of its terms ("auto": kAutomaticOrder), by name. Throw Error with the
/// names that there are.
data::LensModel LensNamed(const std::string& name);
int OrderNamed(data::LensModel lens, const std::string& name);

}  // namespace unfurl::python
