#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "base/random.h"

namespace unfurl::campaign {

/// A law to draw from, with its true mean and standard deviation.
struct Population {
  std::string name;
  std::function<double(Rng&)> draw;
  double mean, sigma;
};

inline void PrintTo(const Population& p, std::ostream* out) { *out << p.name; }

inline std::vector<Population> Populations() {
  const double e = std::exp(0.25);  // of a logarithm with sigma 0.5
  return {{"normal", [](Rng& r) { return 3.0 + 2.0 * r.Normal(); }, 3.0, 2.0},
          {"uniform", [](Rng& r) { return r.Uniform(); }, 0.5, std::sqrt(1.0 / 12.0)},
          {"exponential", [](Rng& r) { return -std::log(1.0 - r.Uniform()); }, 1.0, 1.0},
          {"log_normal", [](Rng& r) { return std::exp(0.5 * r.Normal()); }, std::sqrt(e),
           std::sqrt(e * (e - 1.0))}};
}

inline std::vector<double> Draw(const Population& population, int n, Rng& rng) {
  std::vector<double> x(static_cast<std::size_t>(n));
  for (double& v : x) v = population.draw(rng);
  return x;
}

/// Three standard deviations of a share that is `share`, found in `repeats`.
inline double ShareError(double share, int repeats) {
  return 3.0 * std::sqrt(share * (1.0 - share) / repeats);
}

}  // namespace unfurl::campaign
