#include "measure/ray.h"

#include <cmath>

namespace unfurl::measure {

bool Refract(const Eigen::Vector3d& d, const Eigen::Vector3d& normal, double n1, double n2,
             Eigen::Vector3d* out) {
  const double ratio = n1 / n2;
  const double along = d.dot(normal);  // signed cosine of incidence
  const double cos2 = 1.0 - ratio * ratio * (1.0 - along * along);
  if (cos2 <= 0.0) return false;
  const double out_along = std::copysign(std::sqrt(cos2), along);
  *out = ratio * d + (out_along - ratio * along) * normal;
  return true;
}

double Transmission(double cos_1, double cos_2, double n1, double n2) {
  const double s = (n1 * cos_1 - n2 * cos_2) / (n1 * cos_1 + n2 * cos_2);
  const double p = (n1 * cos_2 - n2 * cos_1) / (n1 * cos_2 + n2 * cos_1);
  return 1.0 - 0.5 * (s * s + p * p);
}

bool Surface::Intersect(const Ray& ray, Eigen::Vector3d* hit, Eigen::Vector3d* normal) const {
  const double x = ray.origin.x() - x0;
  const double z = ray.origin.z() - z0;
  const double dx = ray.direction.x();
  const double dz = ray.direction.z();
  // A t^2 - 2 B t + C = 0, solved so that c -> 0 loses no digits.
  const double A = curvature * (dx * dx + dz * dz);
  const double B = dz - curvature * (x * dx + z * dz);
  const double C = curvature * (x * x + z * z) - 2.0 * z;
  const double discriminant = B * B - A * C;
  if (discriminant <= 0.0) return false;
  const double t = C / (B + std::copysign(std::sqrt(discriminant), B));
  *hit = ray.origin + t * ray.direction;
  *normal = {curvature * (hit->x() - x0), 0.0, curvature * (hit->z() - z0) - 1.0};
  return true;
}

}  // namespace unfurl::measure
