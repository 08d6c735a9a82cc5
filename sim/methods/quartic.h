#pragma once

#include <array>
#include <cstddef>

namespace unfurl::sim {

// Chebyshev's five places of [0, 1], all within: a polynomial through values there is near them
// everywhere. Watches hold laws and functions against it: about what a step's stages see.
inline constexpr std::array<double, 5> kQuarticPlaces = {
    0.02447174185242318, 0.20610737385376343, 0.5, 0.7938926261462366, 0.9755282581475768};

// The quartic through `values` at these places.
inline double QuarticAt(const std::array<double, 5>& values, double at) {
  double sum = 0.0;
  for (std::size_t k = 0; k < values.size(); ++k) {
    double w = values[k];
    for (std::size_t j = 0; j < values.size(); ++j) {
      if (j != k) w *= (at - kQuarticPlaces[j]) / (kQuarticPlaces[k] - kQuarticPlaces[j]);
    }
    sum += w;
  }
  return sum;
}

}  // namespace unfurl::sim
