#pragma once

#include <string>

namespace unfurl {

// A number as a person reads it: `significant` digits, no exponent between 1e-4 and 1e7, trailing
// zeros kept (they say how well it is known), a true minus sign, an en dash for NaN.
std::string Number(double value, int significant = 4);

// "0.005213 ± 0.000021": the error with two significant digits, the value to the same place.
// Without a finite positive error it is Number(value).
std::string NumberWithError(double value, double sigma, int significant = 4);

// Significant digits by which the ends of an interval, and what lies in it, can be told apart: its
// width gets two; `least` where it is wide, empty or open, and no more than a double has.
int IntervalDigits(double low, double high, int least = 5);

// "0.019999998 to 0.020000003", by those digits; an end that is not finite is "open".
std::string IntervalText(double low, double high, int least = 5);
// One of the ends, or a value between them.
std::string IntervalEnd(double value, int digits);

// " rad"; nothing for "1", the unit of plain numbers, and for none.
std::string UnitAfter(const std::string& unit);

}  // namespace unfurl
