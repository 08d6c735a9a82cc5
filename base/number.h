#pragma once

#include <string>

namespace unfurl {

// A number as a person reads it: `significant` digits, no exponent between 1e-4 and 1e7, trailing
// zeros kept (they say how well it is known), a true minus sign, an en dash for NaN.
std::string Number(double value, int significant = 4);

// "0.005213 ± 0.000021": the error with two significant digits, the value to the same place.
// Without a finite positive error it is Number(value).
std::string NumberWithError(double value, double sigma, int significant = 4);

}  // namespace unfurl
