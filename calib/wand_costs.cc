#include "calib/wand_costs.h"

#include <ceres/cost_function.h>
#include <ceres/manifold.h>
#include <ceres/sized_cost_function.h>

#include <cmath>

#include "base/dense.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

using RowMajor = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
using Vector3Map = Eigen::Map<const Eigen::Vector3d>;

// Two directions across a unit vector, the same ones for the same vector.
Eigen::Matrix<double, 3, 2> Across(const Eigen::Vector3d& d) {
  Eigen::Matrix<double, 3, 2> out;
  out.col(0) = d.unitOrthogonal();
  out.col(1) = d.cross(out.col(0));
  return out;
}

class PoseManifold : public ceres::Manifold {
 public:
  explicit PoseManifold(bool moving) : tangent_(moving ? kMovingTangent : kStillTangent) {}
  int AmbientSize() const override { return kPoseAmbient; }
  int TangentSize() const override { return tangent_; }

  bool Plus(const double* x, const double* delta, double* out) const override {
    const Eigen::Vector3d d = Vector3Map(x + 3);
    std::copy(x, x + kPoseAmbient, out);
    for (int k = 0; k < 3; ++k) out[k] += delta[k];
    const Eigen::Vector3d turned = d + Across(d) * Eigen::Map<const Eigen::Vector2d>(delta + 3);
    Eigen::Map<Eigen::Vector3d>(out + 3) = turned.normalized();
    for (int k = kStillTangent; k < tangent_; ++k) out[k + 1] += delta[k];
    return true;
  }

  bool PlusJacobian(const double* x, double* jacobian) const override {
    RowMajor J(jacobian, kPoseAmbient, tangent_);
    J.setZero();
    J.topLeftCorner<3, 3>().setIdentity();
    J.block<3, 2>(3, 3) = Across(Vector3Map(x + 3));
    for (int k = kStillTangent; k < tangent_; ++k) J(k + 1, k) = 1.0;
    return true;
  }

  bool Minus(const double* y, const double* x, double* delta) const override {
    const Eigen::Vector3d d = Vector3Map(x + 3), e = Vector3Map(y + 3);
    for (int k = 0; k < 3; ++k) delta[k] = y[k] - x[k];
    Eigen::Map<Eigen::Vector2d>(delta + 3) = Across(d).transpose() * e / d.dot(e);
    for (int k = kStillTangent; k < tangent_; ++k) delta[k] = y[k + 1] - x[k + 1];
    return true;
  }

  bool MinusJacobian(const double* x, double* jacobian) const override {
    RowMajor J(jacobian, tangent_, kPoseAmbient);
    J.setZero();
    J.topLeftCorner<3, 3>().setIdentity();
    J.block<2, 3>(3, 3) = Across(Vector3Map(x + 3)).transpose();
    for (int k = kStillTangent; k < tangent_; ++k) J(k, k + 1) = 1.0;
    return true;
  }

 private:
  int tangent_;
};

class MarkCost : public ceres::CostFunction {
 public:
  MarkCost(double u_px, double sigma_px, const MarkFlash& flash, const CameraPrior& prior,
           const BundleUnits& units)
      : u_px_(u_px), weight_(1.0 / sigma_px), flash_(flash), prior_(prior), units_(units) {
    set_num_residuals(1);
    *mutable_parameter_block_sizes() = {kAmbient, kPoseAmbient, flash.marks - 1};
  }

  bool Evaluate(double const* const* x, double* residual, double** jacobians) const override {
    data::RigCamera camera;
    camera.lens = prior_.lens;
    Unpack(x[0], units_, &camera);
    const double* pose = x[1];
    const double t = flash_.after;
    const double place =
        flash_.mark == 0 ? flash_.first_place : units_.length * x[2][flash_.mark - 1];
    const Eigen::Vector3d turned = Vector3Map(pose + 3) + t * Vector3Map(pose + 9);
    const double norm = turned.norm();
    if (!(norm > 0.0)) return false;
    const Eigen::Vector3d along = turned / norm;
    const Eigen::Vector3d p =
        units_.length * (Vector3Map(pose) + t * Vector3Map(pose + 6)) + place * along;
    measure::Projection projection;
    if (!measure::Project(camera, p, &projection)) return false;
    residual[0] = weight_ * (projection.u_px - u_px_);
    if (jacobians == nullptr) return true;
    const Eigen::RowVector3d by_p = weight_ * projection.du_dp;
    if (jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 1, kAmbient>> J(jacobians[0]);
      J.setZero();
      J.head<3>() = weight_ * projection.du_dc.head<3>();
      J.tail<kTail>() = weight_ * projection.du_dc.tail<kTail>();
      for (int k = 9; k < kAmbient; ++k) J(k) *= units_.Of(k);
      for (int k = 0; k < kTerms; ++k) {
        if (prior_.Fixed(k)) J(kFirst + k) = 0.0;
      }
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 1, kPoseAmbient>> J(jacobians[1]);
      const Eigen::RowVector3d across = place / norm * (by_p - by_p.dot(along) * along.transpose());
      J.segment<3>(0) = units_.length * by_p;
      J.segment<3>(3) = across;
      J.segment<3>(6) = t * units_.length * by_p;
      J.segment<3>(9) = t * across;
    }
    if (jacobians[2] != nullptr) {
      std::fill(jacobians[2], jacobians[2] + flash_.marks - 1, 0.0);
      if (flash_.mark > 0) jacobians[2][flash_.mark - 1] = units_.length * by_p.dot(along);
    }
    return true;
  }

 private:
  double u_px_, weight_;
  MarkFlash flash_;
  const CameraPrior& prior_;  // outlives the problem
  const BundleUnits& units_;
};

class MotionCost : public ceres::SizedCostFunction<12, kPoseAmbient, kPoseAmbient> {
 public:
  MotionCost(double interval, double unrest, double arm, const BundleUnits& units)
      : interval_(interval), scale_{units.length / std::sqrt(unrest), arm / std::sqrt(unrest)} {}

  // Of a place x and its rate v the covariance is unrest [T^3/3, T^2/2; T^2/2, T]; its Cholesky
  // factor [sqrt(T^3/3), 0; sqrt(3 T)/2, sqrt(T)/2].
  bool Evaluate(double const* const* x, double* residual, double** jacobians) const override {
    const double T = interval_, first = 1.0 / std::sqrt(T * T * T / 3.0);
    const double second = 2.0 / std::sqrt(T), slope = 1.5 / T;
    for (int part = 0; part < 2; ++part) {  // middle, direction
      for (int k = 0; k < 3; ++k) {
        const int at = 3 * part + k, rate = 6 + at, row = 6 * part + k;
        const double step = x[1][at] - x[0][at] - T * x[0][rate];
        const double change = x[1][rate] - x[0][rate];
        residual[row] = scale_[part] * first * step;
        residual[row + 3] = scale_[part] * second * (change - slope * step);
      }
    }
    if (jacobians == nullptr) return true;
    for (int side = 0; side < 2; ++side) {
      if (jacobians[side] == nullptr) continue;
      Eigen::Map<Eigen::Matrix<double, 12, kPoseAmbient, Eigen::RowMajor>> J(jacobians[side]);
      J.setZero();
      const double sign = side == 0 ? -1.0 : 1.0;
      for (int part = 0; part < 2; ++part) {
        for (int k = 0; k < 3; ++k) {
          const int at = 3 * part + k, rate = 6 + at, row = 6 * part + k;
          J(row, at) = sign * scale_[part] * first;
          J(row + 3, at) = -sign * scale_[part] * second * slope;
          J(row + 3, rate) = sign * scale_[part] * second;
          if (side == 1) continue;
          J(row, rate) = -scale_[part] * first * T;
          J(row + 3, rate) += scale_[part] * second * slope * T;
        }
      }
    }
    return true;
  }

 private:
  double interval_;
  std::array<double, 2> scale_;
};

class FrameCost : public ceres::CostFunction {
 public:
  FrameCost(const std::vector<data::RigCamera>& cameras, const BundleUnits& units) {
    for (const data::RigCamera& camera : cameras) {
      R_CW_.push_back(camera.R_CW);
      p_WC_.emplace_back(camera.p_WC / units.length);
      mutable_parameter_block_sizes()->push_back(kAmbient);
    }
    set_num_residuals(6);
  }

  bool Evaluate(double const* const* x, double* residual, double** jacobians) const override {
    using Rotation = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    Eigen::Map<Eigen::Matrix<double, 6, 1>> r(residual);
    r.setZero();
    for (std::size_t j = 0; j < R_CW_.size(); ++j) {
      const Eigen::Matrix3d turn = Eigen::Map<const Rotation>(x[j]) * R_CW_[j].transpose();
      // The sine of the turn times its axis, in W.
      const Eigen::Vector3d sine(0.5 * (turn(2, 1) - turn(1, 2)), 0.5 * (turn(0, 2) - turn(2, 0)),
                                 0.5 * (turn(1, 0) - turn(0, 1)));
      r.head<3>() += (Vector3Map(x[j] + 9) - p_WC_[j]) / kHold;
      r.tail<3>() += R_CW_[j].transpose() * sine / kHold;
      if (jacobians == nullptr || jacobians[j] == nullptr) continue;
      Eigen::Map<Eigen::Matrix<double, 6, kAmbient, Eigen::RowMajor>> J(jacobians[j]);
      J.setZero();
      J.block<3, 3>(0, 9) = Eigen::Matrix3d::Identity() / kHold;
      // [w]x M + M' [w]x = [(tr M - M) w]x
      J.block<3, 3>(3, 0) =
          0.5 / kHold * R_CW_[j].transpose() * (turn.trace() * Eigen::Matrix3d::Identity() - turn);
    }
    return true;
  }

 private:
  // Of the solver's length, and [rad]. Any value gives the same rig, as nothing else holds the
  // frame; a stiff one would make the search follow its bend.
  static constexpr double kHold = 0.03;
  std::vector<Eigen::Matrix3d> R_CW_;
  std::vector<Eigen::Vector3d> p_WC_;
};

}  // namespace

PoseBlock PackPose(const WandState& state, int pose, const BundleUnits& units) {
  PoseBlock x;
  Eigen::Map<Eigen::Vector3d>(x.data()) = state.middle.col(pose) / units.length;
  Eigen::Map<Eigen::Vector3d>(x.data() + 3) = state.direction.col(pose);
  Eigen::Map<Eigen::Vector3d>(x.data() + 6) = state.velocity.col(pose) / units.length;
  Eigen::Map<Eigen::Vector3d>(x.data() + 9) = state.turning.col(pose);
  return x;
}

void UnpackPose(const double* x, int pose, const BundleUnits& units, WandState* state) {
  state->middle.col(pose) = units.length * Vector3Map(x);
  state->direction.col(pose) = Vector3Map(x + 3);
  state->velocity.col(pose) = units.length * Vector3Map(x + 6);
  state->turning.col(pose) = Vector3Map(x + 9);
}

std::unique_ptr<ceres::Manifold> MakePoseManifold(bool moving) {
  return std::make_unique<PoseManifold>(moving);
}

std::unique_ptr<ceres::CostFunction> MakeMarkCost(double u_px, double sigma_px,
                                                  const MarkFlash& flash, const CameraPrior& prior,
                                                  const BundleUnits& units) {
  return std::make_unique<MarkCost>(u_px, sigma_px, flash, prior, units);
}

std::unique_ptr<ceres::CostFunction> MakeMotionCost(double interval, double unrest, double arm,
                                                    const BundleUnits& units) {
  return std::make_unique<MotionCost>(interval, unrest, arm, units);
}

std::unique_ptr<ceres::CostFunction> MakeFrameCost(const std::vector<data::RigCamera>& cameras,
                                                   const BundleUnits& units) {
  return std::make_unique<FrameCost>(cameras, units);
}

}  // namespace unfurl::calib
