#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <vector>

#include "calib/bundle.h"
#include "calib/bundle_camera.h"
#include "calib/wand_bundle.h"

namespace ceres {
class CostFunction;
class Manifold;
}  // namespace ceres

namespace unfurl::calib {

/// A pose as Ceres stores it: middle, direction, velocity, turning; lengths in the solver's unit.
inline constexpr int kPoseAmbient = 12;
inline constexpr int kStillTangent = 5;    // middle, and the direction across itself
inline constexpr int kMovingTangent = 11;  // and velocity and turning
using PoseBlock = std::array<double, kPoseAmbient>;

/// A pose in the solver's units, and back.
PoseBlock PackPose(const WandState& state, int pose, const BundleUnits& units);
void UnpackPose(const double* x, int pose, const BundleUnits& units, WandState* state);

/// The direction stays a unit vector; velocity and turning stay 0 where the bar is still.
std::unique_ptr<ceres::Manifold> MakePoseManifold(bool moving);

/// A reading of a mark against its prediction, whitened; of a camera's block, a pose and the places
/// of marks 1 to m - 1. Mark 0 has its own place, which is held. Prior and units outlive it.
struct MarkFlash {
  int mark = 0, marks = 2;
  double first_place = 0.0;  // of mark 0 [m]
  double after = 0.0;        // [s]
};
std::unique_ptr<ceres::CostFunction> MakeMarkCost(double u_px, double sigma_px,
                                                  const MarkFlash& flash, const CameraPrior& prior,
                                                  const BundleUnits& units);

/// Two neighbouring poses against motion by white acceleration of density `unrest` [m^2/s^3] over
/// `interval` [s], whitened; the direction's times `arm` [m]. [constant-velocity model: Bar-Shalom,
/// Li and Kirubarajan, section 6.2.2]
std::unique_ptr<ceres::CostFunction> MakeMotionCost(double interval, double unrest, double arm,
                                                    const BundleUnits& units);

/// Six residuals that hold the frame where the cameras stood: their mean shift and turn are none.
std::unique_ptr<ceres::CostFunction> MakeFrameCost(const std::vector<data::RigCamera>& cameras,
                                                   const BundleUnits& units);

}  // namespace unfurl::calib
