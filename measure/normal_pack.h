#pragma once

#include <bit>
#include <cstdint>
#include <numbers>

// Packs go between functions of one file only, all of them inlined.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace unfurl::measure {

// The normal distribution for eight values at once, in the compiler's own vectors: as wide as the
// machine has them, the same results everywhere. Relative error 1e-9; from 37 sigmas out, 0.

inline constexpr int kLanes = 8;  // doubles in 64 bytes
using Pack = double __attribute__((vector_size(64)));
using PackInt = std::int64_t __attribute__((vector_size(64)));

inline Pack Broadcast(double x) { return Pack{x, x, x, x, x, x, x, x}; }

inline double Sum(const Pack& x) {
  return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]));
}

// e^y for y <= 0.
inline Pack ExpOfNegative(Pack y) {
  const Pack lowest = Broadcast(-700.0);
  y = y < lowest ? lowest : y;
  // y = n ln 2 + r: adding 1.5 * 2^52 rounds to a whole number, which then stands in the low bits.
  constexpr double kShift = 6755399441055744.0;
  const Pack shifted = y * std::numbers::log2e + kShift;
  const Pack n = shifted - kShift;
  const Pack r = (y - n * 0.693147180369123816490) - n * 1.90821492927058770002e-10;
  // Taylor to r^11: |r| < 0.347.
  Pack p = Broadcast(1.0 / 39916800.0);
  p = p * r + 1.0 / 3628800.0;
  p = p * r + 1.0 / 362880.0;
  p = p * r + 1.0 / 40320.0;
  p = p * r + 1.0 / 5040.0;
  p = p * r + 1.0 / 720.0;
  p = p * r + 1.0 / 120.0;
  p = p * r + 1.0 / 24.0;
  p = p * r + 1.0 / 6.0;
  p = p * r + 0.5;
  p = p * r + 1.0;
  p = p * r + 1.0;
  const PackInt exponent = std::bit_cast<PackInt>(shifted) << 52;
  const PackInt scaled = std::bit_cast<PackInt>(p) + exponent;
  return std::bit_cast<Pack>(scaled);
}

// pdf = exp(-z^2/2) / sqrt(2 pi), cdf = Phi(z).
inline void Normal(const Pack& z, Pack* pdf, Pack* cdf) {
  *pdf = ExpOfNegative(-0.5 * z * z) * (std::numbers::inv_sqrtpi / std::numbers::sqrt2);
  // Mills' ratio (1 - Phi(x)) / pdf(x), x >= 0, is t times a polynomial in 2 t - 1, t = 1/(1 +
  // x/5): Chebyshev interpolation of degree 12, error below 1.1e-9.
  const Pack x = z < 0.0 ? -z : z;
  const Pack t = 1.0 / (1.0 + 0.2 * x);
  const Pack s = 2.0 * t - 1.0;
  Pack g = Broadcast(4.9735739487197443e-06);
  g = g * s + 1.9390116735761556e-05;
  g = g * s - 2.5935491107221565e-05;
  g = g * s - 0.00026657433665906624;
  g = g * s - 0.00040218325817516118;
  g = g * s + 0.0014967932384829434;
  g = g * s + 0.010425723162483838;
  g = g * s + 0.03465205897921278;
  g = g * s + 0.082728866380256741;
  g = g * s + 0.15718207705650494;
  g = g * s + 0.24830941504128196;
  g = g * s + 0.33357332395449407;
  g = g * s + 0.38561620943063152;
  const Pack tail = *pdf * t * g;
  *cdf = z < 0.0 ? tail : 1.0 - tail;
}

}  // namespace unfurl::measure
