#pragma once

#include <Eigen/Core>

#include "base/random.h"

namespace unfurl {

// Three independent draws, z first. In what order a constructor's arguments are drawn each compiler
// decides for itself, and one seed gave two laboratories; this is g++'s order, by which the shipped
// recordings were made.
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
