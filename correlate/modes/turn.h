#pragma once

#include <numbers>

namespace unfurl::correlate {

inline constexpr double kTau = 2.0 * std::numbers::pi;  // [rad]

}  // namespace unfurl::correlate
