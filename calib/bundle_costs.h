#pragma once

#include <Eigen/Core>
#include <memory>

#include "calib/bundle.h"
#include "calib/bundle_camera.h"
#include "calib/observations.h"

namespace ceres {
class CostFunction;
class LossFunction;
class Manifold;
}  // namespace ceres

namespace unfurl::calib {

/// calib's Loss as Ceres wants it.
std::unique_ptr<ceres::LossFunction> MakeCoreLoss(double width);
/// A camera's block moves by a rotation and by what its prior does not hold.
std::unique_ptr<ceres::Manifold> MakeCameraManifold(const CameraPrior& prior);

/// A reading against its prediction, whitened, of a camera's block and a point. Prior and units
/// outlive it.
std::unique_ptr<ceres::CostFunction> MakeReadingCost(double u_px, double sigma_px,
                                                     const CameraPrior& prior,
                                                     const BundleUnits& units);
/// A point against its survey, whitened, common errors taken off; of a point and those errors.
std::unique_ptr<ceres::CostFunction> MakeSurveyCost(const Observations& data, Eigen::Index i,
                                                    double information_scale,
                                                    const BundleUnits& units);
/// What is believed of a camera before its readings speak, whitened; of a camera's block.
std::unique_ptr<ceres::CostFunction> MakePriorCost(const CameraPrior& prior, int pixels,
                                                   const BundleUnits& units);

}  // namespace unfurl::calib
