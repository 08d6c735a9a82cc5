#pragma once

#include <string>

namespace unfurl {

/// A number with so many decimals, and below 0.1 as many as leave it so many significant digits:
/// times of records of milliseconds stay apart as those of minutes do. "1.9683", "0.001968".
std::string FixedNumber(double value, int decimals = 4);

}  // namespace unfurl
