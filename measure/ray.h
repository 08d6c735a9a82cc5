#pragma once

#include <Eigen/Core>

namespace unfurl::measure {

struct Ray {
  Eigen::Vector3d origin;     // [m]
  Eigen::Vector3d direction;  // unit [-]
};

// Snell's law in vector form: the unit direction `d` after a surface of unit normal `normal`
// (either side) between the indices n1 and n2. False on total reflection.
bool Refract(const Eigen::Vector3d& d, const Eigen::Vector3d& normal, double n1, double n2,
             Eigen::Vector3d* out);

// Share of unpolarised light that passes such a surface [-] (Fresnel), from the cosines of
// incidence and refraction.
double Transmission(double cos_1, double cos_2, double n1, double n2);

// A plane across z, or a circular cylinder with its axis along y:
//   c ((x - x0)^2 + (z - z0)^2) - 2 (z - z0) = 0,
// with its vertex at (x0, z0) and its centre of curvature at z0 + 1/c; c = 0 is the plane.
struct Surface {
  double x0 = 0.0;         // [m]
  double z0 = 0.0;         // [m]
  double curvature = 0.0;  // c [1/m]

  // The hit nearest to the vertex and the unit normal there; false when the ray misses.
  bool Intersect(const Ray& ray, Eigen::Vector3d* hit, Eigen::Vector3d* normal) const;
};

}  // namespace unfurl::measure
