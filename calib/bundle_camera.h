#pragma once

#include <Eigen/Core>
#include <array>

#include "calib/bundle.h"
#include "calib/observations.h"
#include "calib/parameters.h"

namespace unfurl::calib {

/// A camera as Ceres stores it: R_CW row by row, then p_WC, f, u0, e and the terms.
inline constexpr int kTail = data::kCameraParameters - 3;  // what follows the rotation
inline constexpr int kAmbient = 9 + kTail;                 // numbers of a camera so stored
inline constexpr int kFirst = kAmbient - kTerms;           // of the terms
using CameraBlock = std::array<double, kAmbient>;

/// The optical axis meets the row near its middle: sensors are mounted so to within a few per cent.
/// Over the row [-]. With a wide-angle lens a shift of the image is a turn of the camera, and
/// nothing else tells them apart; with others the readings do, a hundred times better than this.
inline constexpr double kOffsetShare = 0.1;

/// Lengths are solved for over the survey's size and pixels over the row's length, so that the
/// solver's own constants mean the same to a hinge and to a wing.
struct BundleUnits {
  double length = 1.0;  // [m]
  double row = 1.0;     // [px]

  // Of what follows the rotation, by its place in a camera's block.
  double Of(int at) const { return at < 12 || at == 14 ? length : row; }
};
/// The units of a survey and of the longest row.
BundleUnits UnitsOf(const Observations& data, const BundleState& state);

/// A camera in the solver's units, and back; lens, name and row stay as they are in `camera`.
CameraBlock Pack(const data::RigCamera& camera, const BundleUnits& units);
void Unpack(const double* x, const BundleUnits& units, data::RigCamera* camera);

}  // namespace unfurl::calib
