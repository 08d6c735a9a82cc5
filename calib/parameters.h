#pragma once

#include <Eigen/Core>

#include "data/rig.h"

namespace unfurl::calib {

/// A camera's, as an index of matrices.
inline constexpr Eigen::Index kParameters = data::kCameraParameters;
/// A lens's, of them.
inline constexpr int kTerms = static_cast<int>(data::kLensTerms);

}  // namespace unfurl::calib
