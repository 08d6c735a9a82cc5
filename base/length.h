#pragma once

#include <string>
#include <string_view>

namespace unfurl {

// A length for people, with three significant digits and the unit that suits it: "0.312 mm",
// "41.2 um", "1.28 m". "-" for what is not finite.
std::string LengthText(double metres);
// An error and its prediction, or several lengths, in one unit: that of the largest. The unit's
// name, and how many of them a metre has.
struct LengthUnit {
  const char* name;
  double per_metre;  // [1/m]
};
LengthUnit UnitFor(double metres);

// "0.5mm", "2 cm", "0.0005": a number and nm, um, mm, cm, m, ft or in; without a unit metres. False
// for anything else.
bool ParseLength(std::string_view text, double* metres);

}  // namespace unfurl
