#pragma once

#include <cmath>
#include <string>

namespace unfurl::report {

// What to take off coordinates that are far from zero for what they span, as those of a surveyor's
// grid are: ticks would be all alike, and 32 bits of a view in space would show a lattice. A whole
// number; 0 where they are near.
inline double FarOrigin(double low, double high) {
  constexpr double kFar = 300.0;  // spans: five digits before the one that ticks differ in
  const double middle = 0.5 * (low + high);
  return std::fabs(middle) > kFar * (high - low) ? std::floor(low) : 0.0;
}

/// "y less 5400000": the name of a coordinate that so much is taken off; the name alone where
/// nothing is.
std::string NameLess(const std::string& name, double origin);

}  // namespace unfurl::report
