#pragma once

#include <Eigen/Core>

#include "data/rig.h"

namespace unfurl::calib {

/// A camera's, as an index of matrices.
inline constexpr Eigen::Index kParameters = data::kCameraParameters;

}  // namespace unfurl::calib
