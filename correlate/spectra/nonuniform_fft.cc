#include "correlate/spectra/nonuniform_fft.h"

#include <array>
#include <cmath>
#include <numbers>

#include "correlate/spectra/fft.h"

namespace unfurl::correlate {

namespace {

using Complex = std::complex<double>;

constexpr double kTwoPi = 2.0 * std::numbers::pi;  // a full turn [rad]
// Grid points that a term is spread over to either side, at twice as many points as sums: the
// error, exp(-2 pi reach / 3), is 2e-13 [Greengard and Lee 2004, section 3].
constexpr int kReach = 14;

}  // namespace

std::vector<Complex> NonuniformFft(std::span<const double> x, std::span<const Complex> c,
                                   std::size_t count) {
  if (count == 0) return {};
  // k runs from -half to count - half - 1, so that the Gaussians' transform falls least.
  const std::size_t half = count / 2;
  const std::size_t n = FastLength(std::max<std::size_t>(2 * count, 2 * kReach + 2));
  const auto size = static_cast<double>(n);
  const double ratio = size / static_cast<double>(count);
  // Width of the Gaussian exp(-x^2 / 4 tau), equation (9) there.
  const double tau =
      std::numbers::pi * kReach /
      (static_cast<double>(count) * static_cast<double>(count) * ratio * (ratio - 0.5));
  const double step = kTwoPi / size;

  // 1. Spread. exp(-(d - m h)^2 / 4 tau) in three factors, one of which does not depend on the
  // term.
  std::array<double, 2 * kReach + 1> fixed;
  for (int m = -kReach; m <= kReach; ++m) {
    fixed[static_cast<std::size_t>(m + kReach)] = std::exp(-m * m * step * step / (4.0 * tau));
  }
  std::vector<double> real(n, 0.0), imaginary(n, 0.0);
  for (std::size_t j = 0; j < x.size(); ++j) {
    const double turned = x[j] - kTwoPi * std::floor(x[j] / kTwoPi);
    const double nearest = std::round(turned / step);
    const double d = turned - nearest * step;
    const Complex value = c[j] * std::polar(1.0, static_cast<double>(half) * x[j]);
    const double at = std::exp(-d * d / (4.0 * tau)), grow = std::exp(d * step / (2.0 * tau));
    double factor = at * std::pow(grow, -kReach);
    std::size_t place = (static_cast<std::size_t>(nearest) + n - kReach) % n;
    for (const double f : fixed) {
      // Conjugated: RealFft has the other sign in its exponent.
      real[place] += value.real() * factor * f;
      imaginary[place] -= value.imag() * factor * f;
      factor *= grow;
      if (++place == n) place = 0;
    }
  }

  // 2. Transform; 3. divide the Gaussian's own transform out.
  const std::vector<Complex> R = RealFft(real), I = RealFft(imaginary);
  std::vector<Complex> out(count);
  const double scale = std::sqrt(std::numbers::pi / tau) / size;
  for (std::size_t i = 0; i < count; ++i) {
    const bool negative = i < half;
    const std::size_t k = negative ? half - i : i - half;
    const Complex a = negative ? std::conj(R[k]) : R[k], b = negative ? std::conj(I[k]) : I[k];
    const auto order = static_cast<double>(k);
    out[i] = std::conj(a + Complex(0.0, 1.0) * b) * scale * std::exp(order * order * tau);
  }
  return out;
}

}  // namespace unfurl::correlate
