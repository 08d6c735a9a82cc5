#include "calib/bundle_costs.h"

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/sized_cost_function.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/dense.h"
#include "base/pose.h"
#include "calib/known_lens.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

using RowMajor = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
Eigen::Index Column(std::size_t k) { return 3 + static_cast<Eigen::Index>(k); }

// Rotation by a small vector, R <- Exp(w) R; the rest by addition, but for terms that are held.
// The cost functions give their derivatives by the tangent in the first 3 and last columns of the
// ambient ones, so PlusJacobian only picks those.
class CameraManifold : public ceres::Manifold {
 public:
  // Of a camera whose prior says which terms are held.
  explicit CameraManifold(const CameraPrior& prior);
  int AmbientSize() const override { return kAmbient; }
  int TangentSize() const override { return 3 + static_cast<int>(free_.size()); }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;

 private:
  std::vector<int> free_;  // ambient indices
};

CameraManifold::CameraManifold(const CameraPrior& prior) {
  for (int k = 9; k < kAmbient; ++k) {
    if (k < kFirst || !prior.Fixed(k - kFirst)) free_.push_back(k);
  }
}

bool CameraManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  using Rotation = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const Eigen::Vector3d w(delta[0], delta[1], delta[2]);
  const Rotation turned = RotationFromVector(w) * Eigen::Map<const Rotation>(x);
  std::copy(turned.data(), turned.data() + 9, x_plus_delta);
  std::copy(x + 9, x + kAmbient, x_plus_delta + 9);
  for (std::size_t k = 0; k < free_.size(); ++k) x_plus_delta[free_[k]] += delta[3 + k];
  return true;
}

bool CameraManifold::PlusJacobian(const double*, double* jacobian) const {
  RowMajor J(jacobian, kAmbient, TangentSize());
  J.setZero();
  J.topLeftCorner<3, 3>().setIdentity();
  for (std::size_t k = 0; k < free_.size(); ++k) J(free_[k], Column(k)) = 1.0;
  return true;
}

bool CameraManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  using Rotation = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const Eigen::Matrix3d R =
      Eigen::Map<const Rotation>(y) * Eigen::Map<const Rotation>(x).transpose();
  const Eigen::Vector3d w = VectorFromRotation(R);
  std::copy(w.data(), w.data() + 3, y_minus_x);
  for (std::size_t k = 0; k < free_.size(); ++k) y_minus_x[3 + k] = y[free_[k]] - x[free_[k]];
  return true;
}

bool CameraManifold::MinusJacobian(const double*, double* jacobian) const {
  RowMajor J(jacobian, TangentSize(), kAmbient);
  J.setZero();
  J.topLeftCorner<3, 3>().setIdentity();
  for (std::size_t k = 0; k < free_.size(); ++k) J(Column(k), free_[k]) = 1.0;
  return true;
}

class CoreLoss : public ceres::LossFunction {
 public:
  explicit CoreLoss(double width) : width_(width) {}
  void Evaluate(double s, double rho[3]) const override {
    rho[0] = Loss(s, width_);
    rho[1] = LossWeight(s, width_);
    rho[2] = rho[1] < 1.0 ? -rho[1] / s : 0.0;
  }

 private:
  double width_;
};

// A reading against its prediction, whitened.
class ReadingCost : public ceres::SizedCostFunction<1, kAmbient, 3> {
 public:
  ReadingCost(double u_px, double sigma_px, const CameraPrior& prior, const BundleUnits& units)
      : u_px_(u_px), weight_(1.0 / sigma_px), prior_(prior), units_(units) {}

  bool Evaluate(double const* const* x, double* residual, double** jacobians) const override {
    data::RigCamera camera;
    camera.lens = prior_.lens;
    Unpack(x[0], units_, &camera);
    const Eigen::Vector3d p = units_.length * Eigen::Map<const Eigen::Vector3d>(x[1]);
    if (!jacobians) {
      double u = 0.0;
      if (!measure::Project(camera, p, &u)) return false;
      residual[0] = weight_ * (u - u_px_);
      return true;
    }
    measure::Projection projection;
    if (!measure::Project(camera, p, &projection)) return false;
    residual[0] = weight_ * (projection.u_px - u_px_);
    if (jacobians[0]) {
      Eigen::Map<Eigen::Matrix<double, 1, kAmbient>> J(jacobians[0]);
      J.setZero();
      J.head<3>() = weight_ * projection.du_dc.head<3>();
      J.tail<kTail>() = weight_ * projection.du_dc.tail<kTail>();
      for (int k = 9; k < kAmbient; ++k) J(k) *= units_.Of(k);
      for (int k = 0; k < kTerms; ++k) {
        if (prior_.Fixed(k)) J(kFirst + k) = 0.0;
      }
    }
    if (jacobians[1]) {
      Eigen::Map<Eigen::RowVector3d>(jacobians[1], 3) = weight_ * units_.length * projection.du_dp;
    }
    return true;
  }

 private:
  double u_px_, weight_;
  const CameraPrior& prior_;  // outlives the problem
  const BundleUnits& units_;
};

// Whitened difference between a point and the survey's: L^-1 (P + B q - p) with L L^T the
// covariance and B the shifts by the common errors, where there are any.
class SurveyedPoint : public ceres::CostFunction {
 public:
  SurveyedPoint(const Observations& data, Eigen::Index i, double information_scale,
                const BundleUnits& units)
      : p_(data.p.col(i) / units.length), shift_(3, static_cast<Eigen::Index>(data.common.size())) {
    whiten_ = Eigen::LLT<Eigen::Matrix3d>(data.cov[static_cast<std::size_t>(i)])
                  .matrixL()
                  .solve(Eigen::Matrix3d::Identity());
    whiten_ *= std::sqrt(information_scale) * units.length;
    for (Eigen::Index m = 0; m < shift_.cols(); ++m) {
      shift_.col(m) = data.common[static_cast<std::size_t>(m)].shift.col(i) / units.length;
    }
    set_num_residuals(3);
    mutable_parameter_block_sizes()->push_back(3);
    if (shift_.cols() > 0) {
      mutable_parameter_block_sizes()->push_back(static_cast<int>(shift_.cols()));
    }
  }

  bool Evaluate(double const* const* x, double* residual, double** jacobians) const override {
    Eigen::Vector3d difference(x[0][0] - p_(0), x[0][1] - p_(1), x[0][2] - p_(2));
    for (Eigen::Index m = 0; m < shift_.cols(); ++m) difference += x[1][m] * shift_.col(m);
    Eigen::Map<Eigen::Vector3d>(residual, 3) = whiten_ * difference;
    if (jacobians && jacobians[0]) {
      Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(jacobians[0], 3, 3) = whiten_;
    }
    if (jacobians && shift_.cols() > 0 && jacobians[1]) {
      Eigen::Map<Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>>(
          jacobians[1], 3, shift_.cols()) = whiten_ * shift_;
    }
    return true;
  }

 private:
  Eigen::Vector3d p_;
  Eigen::Matrix3Xd shift_;
  Eigen::Matrix3d whiten_;
};

constexpr int kPriorRows = 3 + kTerms;  // e, position along the lens axis, u0, the terms

// What is believed of a camera before its readings speak, whitened.
class PriorCost : public ceres::SizedCostFunction<kPriorRows, kAmbient> {
 public:
  PriorCost(const CameraPrior& prior, int pixels, const BundleUnits& units)
      : prior_(prior), pixels_(std::max(1, pixels)), units_(units) {}

  bool Evaluate(double const* const* x, double* residual, double** jacobians) const override {
    const double* p = x[0] + 9;
    const double along = prior_.axis(0) * p[0] + prior_.axis(1) * p[1] + prior_.axis(2) * p[2];
    residual[0] = (units_.length * x[0][14] - prior_.e_mean) / prior_.e_sigma;
    residual[1] = (units_.length * along - prior_.along) / prior_.along_sigma;
    residual[2] = (units_.row * x[0][13] - 0.5 * (pixels_ - 1)) / (kOffsetShare * pixels_);
    for (int k = 0; k < kTerms; ++k) residual[3 + k] = x[0][kFirst + k] / Sigma(k);
    if (!jacobians || !jacobians[0]) return true;
    Eigen::Map<Eigen::Matrix<double, kPriorRows, kAmbient, Eigen::RowMajor>> J(jacobians[0]);
    J.setZero();
    J(0, 14) = units_.length / prior_.e_sigma;
    for (int k = 0; k < 3; ++k) {
      J(1, 9 + k) = units_.length * prior_.axis(k) / prior_.along_sigma;
    }
    J(2, 13) = units_.row / (kOffsetShare * pixels_);
    for (int k = 0; k < kTerms; ++k) J(3 + k, kFirst + k) = 1.0 / Sigma(k);
    return true;
  }

 private:
  // Over the row. A term held at zero has a row of its own that keeps it there and moves nothing
  // else.
  double Sigma(int k) const {
    return prior_.Fixed(k) ? 1.0 : prior_.term_sigma_px[static_cast<std::size_t>(k)] / units_.row;
  }
  CameraPrior prior_;
  double pixels_;
  BundleUnits units_;
};

// The same of a camera whose lens is known from a calibration before.
class KnownLensCost : public ceres::SizedCostFunction<kLensParameters + 1, kAmbient> {
 public:
  KnownLensCost(const CameraPrior& prior, const BundleUnits& units) : prior_(prior) {
    for (int k = 0; k < kLensParameters; ++k) unit_(k) = units.Of(kFirstOfBlock + k);
    axis_ = units.length / prior.along_sigma * prior.axis;
  }

  bool Evaluate(double const* const* x, double* residual, double** jacobians) const override {
    const Eigen::Map<const Lens> lens(x[0] + kFirstOfBlock);
    Eigen::Map<Lens> rows(residual);
    rows = prior_.lens_root * (unit_.cwiseProduct(lens) - prior_.lens_mean);
    const Eigen::Map<const Eigen::Vector3d> place(x[0] + 9);
    residual[kLensParameters] = axis_.dot(place) - prior_.along / prior_.along_sigma;
    if (!jacobians || !jacobians[0]) return true;
    Eigen::Map<Eigen::Matrix<double, kLensParameters + 1, kAmbient, Eigen::RowMajor>> J(
        jacobians[0]);
    J.setZero();
    J.topRightCorner<kLensParameters, kLensParameters>() = prior_.lens_root * unit_.asDiagonal();
    J.block<1, 3>(kLensParameters, 9) = axis_.transpose();
    return true;
  }

 private:
  static constexpr int kFirstOfBlock = kAmbient - kLensParameters;
  using Lens = Eigen::Matrix<double, kLensParameters, 1>;
  CameraPrior prior_;
  Lens unit_;
  Eigen::Vector3d axis_;
};

}  // namespace

std::unique_ptr<ceres::LossFunction> MakeCoreLoss(double width) {
  return std::make_unique<CoreLoss>(width);
}

std::unique_ptr<ceres::Manifold> MakeCameraManifold(const CameraPrior& prior) {
  return std::make_unique<CameraManifold>(prior);
}

std::unique_ptr<ceres::CostFunction> MakeReadingCost(double u_px, double sigma_px,
                                                     const CameraPrior& prior,
                                                     const BundleUnits& units) {
  return std::make_unique<ReadingCost>(u_px, sigma_px, prior, units);
}

std::unique_ptr<ceres::CostFunction> MakeSurveyCost(const Observations& data, Eigen::Index i,
                                                    double information_scale,
                                                    const BundleUnits& units) {
  return std::make_unique<SurveyedPoint>(data, i, information_scale, units);
}

std::unique_ptr<ceres::CostFunction> MakePriorCost(const CameraPrior& prior, int pixels,
                                                   const BundleUnits& units) {
  if (prior.KnowsLens()) return std::make_unique<KnownLensCost>(prior, units);
  return std::make_unique<PriorCost>(prior, pixels, units);
}

}  // namespace unfurl::calib
