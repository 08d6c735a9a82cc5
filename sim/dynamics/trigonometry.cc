#include "sim/dynamics/trigonometry.h"

#include <bit>
#include <cstdint>

#include "base/loop.h"

namespace unfurl::sim {

void SinCos(const double* __restrict theta, int n, double* __restrict sine,
            double* __restrict cosine) {
  constexpr double kTwoOverPi = 0.63661977236758134308;  // quadrants per rad
  // pi/2 in three parts; the first two have trailing zeros, so that k times them is exact.
  constexpr double kPart1 = 1.57079625129699707031;
  constexpr double kPart2 = 7.54978941586159635336e-8;
  constexpr double kPart3 = 5.39030285815811905290e-15;
  constexpr double kRound = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to an integer
  UNFURL_INDEPENDENT
  for (int i = 0; i < n; ++i) {
    const double t = theta[i];
    const double shifted = t * kTwoOverPi + kRound;
    const double k = shifted - kRound;
    const double r = ((t - k * kPart1) - k * kPart2) - k * kPart3;
    const double z = r * r;
    double p = 1.58962301576546568060e-10;
    p = p * z - 2.50507477628578072866e-8;
    p = p * z + 2.75573136213857245213e-6;
    p = p * z - 1.98412698295895385996e-4;
    p = p * z + 8.33333333332211858878e-3;
    p = p * z - 1.66666666666666307295e-1;
    const double sr = r + r * z * p;
    double q = -1.13585365213876817300e-11;
    q = q * z + 2.08757008419747316778e-9;
    q = q * z - 2.75573141792967388112e-7;
    q = q * z + 2.48015872888517045348e-5;
    q = q * z - 1.38888888888730564116e-3;
    q = q * z + 4.16666666666665929218e-2;
    const double cr = 1.0 - 0.5 * z + z * z * q;
    // The quadrant is in the low bits of `shifted`.
    const std::uint64_t quadrant = std::bit_cast<std::uint64_t>(shifted);
    const std::uint64_t swap = -(quadrant & 1);  // all ones in odd quadrants
    const std::uint64_t a = std::bit_cast<std::uint64_t>(sr);
    const std::uint64_t b = std::bit_cast<std::uint64_t>(cr);
    const std::uint64_t sin_sign = (quadrant & 2) << 62;
    const std::uint64_t cos_sign = ((quadrant + 1) & 2) << 62;
    sine[i] = std::bit_cast<double>(((a & ~swap) | (b & swap)) ^ sin_sign);
    cosine[i] = std::bit_cast<double>(((b & ~swap) | (a & swap)) ^ cos_sign);
  }
}

}  // namespace unfurl::sim
