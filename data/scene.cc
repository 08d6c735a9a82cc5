#include "data/scene.h"

#include <cmath>
#include <numbers>

namespace unfurl::data {

double HertzStiffness(double radius_i, double radius_j, double modulus_i, double poisson_i,
                      double modulus_j, double poisson_j) {
  const double pi = std::numbers::pi;
  const double h_i = (1.0 - poisson_i * poisson_i) / (pi * modulus_i);
  const double h_j = (1.0 - poisson_j * poisson_j) / (pi * modulus_j);
  const double radius = 1.0 / (1.0 / radius_i + 1.0 / radius_j);
  return 4.0 / (3.0 * pi * (h_i + h_j)) * std::sqrt(radius);
}

double ContactDamping(double mass, double stiffness, double restitution) {
  const double log_e = std::log(restitution);
  const double ratio =
      std::sqrt(log_e * log_e / (log_e * log_e + std::numbers::pi * std::numbers::pi));
  return 2.0 * mass * std::sqrt(stiffness / mass) * ratio;
}

}  // namespace unfurl::data
