#include "base/random.h"

#include <cmath>

namespace unfurl {

namespace {

// SplitMix64 finalizer [Steele, Lea, Flood 2014]: spreads nearby seeds far apart.
std::uint64_t Mix(std::uint64_t z) {
  z += 0x9e3779b97f4a7c15ULL;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

}  // namespace

Rng::Rng(std::uint64_t seed) : seed_(seed), engine_(Mix(seed)) {}

Rng Rng::Stream(std::string_view purpose, std::uint64_t index) const {
  std::uint64_t h = Mix(seed_ ^ 0x6a09e667f3bcc908ULL);
  for (unsigned char c : purpose) h = Mix(h ^ c);
  return Rng(Mix(h ^ index));
}

double Rng::Uniform() { return static_cast<double>(engine_() >> 11) * 0x1.0p-53; }

double Rng::Uniform(double low, double high) { return low + (high - low) * Uniform(); }

double Rng::Normal() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_;
  }
  double a, b, s;
  do {  // Marsaglia's polar method
    a = 2.0 * Uniform() - 1.0;
    b = 2.0 * Uniform() - 1.0;
    s = a * a + b * b;
  } while (s >= 1.0 || s == 0.0);
  const double scale = std::sqrt(-2.0 * std::log(s) / s);
  spare_ = b * scale;
  has_spare_ = true;
  return a * scale;
}

std::uint64_t Rng::Integer(std::uint64_t bound) {
  const std::uint64_t limit = UINT64_MAX - UINT64_MAX % bound;
  std::uint64_t draw;
  do {
    draw = engine_();
  } while (draw >= limit);
  return draw % bound;
}

double Rng::Poisson(double mean) {
  if (mean <= 0.0) return 0.0;
  if (mean > 30.0) {
    const double draw = std::round(mean + std::sqrt(mean) * Normal());
    return draw < 0.0 ? 0.0 : draw;
  }
  double p = std::exp(-mean);
  double cumulative = p;
  const double u = Uniform();
  int k = 0;
  while (u > cumulative && k < 200) {
    ++k;
    p *= mean / k;
    cumulative += p;
  }
  return k;
}

}  // namespace unfurl
