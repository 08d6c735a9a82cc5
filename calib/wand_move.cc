#include <string_view>

#include "base/dense.h"
#include "calib/wand_fit.h"

namespace unfurl::calib {
namespace {

// Whether a lens term, by its name in files ("x^2 y", "a y^3"), is odd in y.
bool OddInY(std::string_view name) {
  const std::size_t at = name.find('y');
  if (at == std::string_view::npos) return false;
  if (at + 1 >= name.size() || name[at + 1] != '^') return true;
  return (name[at + 2] - '0') % 2 == 1;
}

// The change of a camera's 31 numbers from that before.
Eigen::MatrixXd Turned(const data::RigCamera& camera, const Eigen::Matrix3d& R, bool mirror) {
  Eigen::MatrixXd T = Eigen::MatrixXd::Identity(data::kCameraParameters, data::kCameraParameters);
  T.block<3, 3>(3, 3) = mirror ? Eigen::Matrix3d(-R) : R;
  if (!mirror) return T;
  T(0, 0) = T(2, 2) = -1.0;
  const auto& names = data::NamesOf(camera.lens).terms;
  for (std::size_t k = 0; k < data::kLensTerms; ++k) {
    const auto at = data::kFirstTerm + static_cast<Eigen::Index>(k);
    if (OddInY(names[k])) T(at, at) = -1.0;
  }
  return T;
}

}  // namespace

data::RigCamera Mirrored(const data::RigCamera& camera) {
  // With p -> -p the axes X and Z turn about, and Y = Z x X stays: y changes its sign.
  data::RigCamera out = camera;
  out.R_CW.row(0) *= -1.0;
  out.R_CW.row(2) *= -1.0;
  out.p_WC *= -1.0;
  const auto& names = data::NamesOf(camera.lens).terms;
  for (std::size_t k = 0; k < data::kLensTerms; ++k) {
    if (OddInY(names[k])) out.terms_px[k] *= -1.0;
  }
  return out;
}

void MoveWand(const Pose& X, bool mirror, WandFit* fit) {
  const Eigen::Matrix3d R = X.linear();
  const double sign = mirror ? -1.0 : 1.0;
  WandState& state = fit->state;
  const Eigen::Index size = fit->system.covariance.rows();
  Eigen::MatrixXd T = Eigen::MatrixXd::Identity(size, size);
  for (std::size_t j = 0; j < state.cameras.size(); ++j) {
    data::RigCamera& camera = state.cameras[j];
    const auto first = data::kCameraParameters * static_cast<Eigen::Index>(j);
    if (size > 0) {
      T.block<data::kCameraParameters, data::kCameraParameters>(first, first) =
          Turned(camera, R, mirror);
    }
    if (mirror) camera = Mirrored(camera);
    camera.R_CW = camera.R_CW * R.transpose();
    camera.p_WC = X * camera.p_WC;
    CameraPrior& prior = fit->priors[j];
    prior.axis = R * prior.axis;
    prior.along = sign * prior.along + prior.axis.dot(X.translation());
  }
  const Eigen::Matrix3d turn = sign * R;
  state.middle = (turn * state.middle).colwise() + X.translation();
  state.direction = turn * state.direction;
  state.velocity = turn * state.velocity;
  state.turning = turn * state.turning;
  if (state.points.cols() > 0) state.points = (turn * state.points).colwise() + X.translation();
  if (size == 0) return;
  fit->system.covariance = T * fit->system.covariance * T.transpose();
  fit->system.information = T * fit->system.information * T.transpose();
}

}  // namespace unfurl::calib
