#pragma once

#include <Eigen/Core>

#include "base/random.h"

namespace unfurl {

// Three independent draws. In what order the arguments of a constructor
// are drawn each compiler decides for itself, and one seed gave two laboratories: z comes first
// here, as the shipped recordings, made by g++, have it.
inline Eigen::Vector3d NormalVector(Rng* rng) {  // of mean 0 and variance 1
  Eigen::Vector3d out;
  for (Eigen::Index k = 3; k-- > 0;) out(k) = rng->Normal();
  return out;
}
inline Eigen::Vector3d UniformVector(Rng* rng, double low, double high) {  // in [low, high)
  Eigen::Vector3d out;
  for (Eigen::Index k = 3; k-- > 0;) out(k) = rng->Uniform(low, high);
  return out;
}

}  // namespace unfurl
