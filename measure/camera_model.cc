#include "measure/camera_model.h"

#include <cmath>

#include "base/pose.h"
#include "measure/lens/lens.h"

namespace unfurl::measure {
namespace {

struct Ratios {
  Eigen::Vector3d p_C;
  double inverse_z = 0.0, inverse_far = 0.0;  // 1 / Z, 1 / (Z + e) [1/m]
  double x = 0.0, y = 0.0;
};

// The two ratios that a lens sees of a point; false for one that is not in front.
bool RatiosOf(const data::RigCamera& camera, const Eigen::Vector3d& p_W, Ratios* out) {
  out->p_C = camera.R_CW * (p_W - camera.p_WC);
  const double z = out->p_C.z(), far = z + camera.e;
  if (!(z > kLeastSlope * std::abs(out->p_C.x()) && far > kLeastSlope * std::abs(out->p_C.y()))) {
    return false;
  }
  out->inverse_z = 1.0 / z;
  out->inverse_far = 1.0 / far;
  out->x = out->p_C.x() * out->inverse_z;
  out->y = out->p_C.y() * out->inverse_far;
  return true;
}

}  // namespace

bool Project(const data::RigCamera& camera, const Eigen::Vector3d& p_W, double* u_px) {
  Ratios at;
  if (!RatiosOf(camera, p_W, &at)) return false;
  *u_px = camera.u0_px +
          EvaluateLens(camera.lens, at.x, at.y, camera.f_px, camera.terms_px.data()).u_px;
  return true;
}

bool Project(const data::RigCamera& camera, const Eigen::Vector3d& p_W, Projection* out) {
  Ratios at;
  if (!RatiosOf(camera, p_W, &at)) return false;
  const LensImage image =
      EvaluateLens(camera.lens, at.x, at.y, camera.f_px, camera.terms_px.data());
  out->u_px = camera.u0_px + image.u_px;
  // The chain rule through x = X / Z and y = Y / (Z + e).
  const Eigen::RowVector3d du_dp_C(
      image.du_dx * at.inverse_z, image.du_dy * at.inverse_far,
      -image.du_dx * at.x * at.inverse_z - image.du_dy * at.y * at.inverse_far);
  out->du_dp = du_dp_C * camera.R_CW;
  out->du_dc.head<3>() = -du_dp_C * Skew(at.p_C);  // Exp(w) p_C = p_C - [p_C]x w to first order
  out->du_dc.segment<3>(3) = -out->du_dp;
  out->du_dc(6) = image.du_df;
  out->du_dc(7) = 1.0;
  out->du_dc(8) = -image.du_dy * at.y * at.inverse_far;
  for (std::size_t k = 0; k < data::kLensTerms; ++k) {
    out->du_dc(data::kFirstTerm + static_cast<Eigen::Index>(k)) = image.du_dt[k];
  }
  return true;
}

Eigen::Vector3d ReadingGradient(const data::RigCamera& camera, const Eigen::Vector3d& p_W) {
  Projection seen;
  if (!Project(camera, p_W, &seen)) return Eigen::Vector3d::Zero();
  return seen.du_dp.transpose();
}

data::RigCamera Perturbed(const data::RigCamera& camera,
                          const Eigen::Matrix<double, data::kCameraParameters, 1>& change) {
  data::RigCamera out = camera;
  out.R_CW = RotationFromVector(change.head<3>()) * camera.R_CW;
  out.p_WC += change.segment<3>(3);
  out.f_px += change(6);
  out.u0_px += change(7);
  out.e += change(8);
  for (std::size_t k = 0; k < data::kLensTerms; ++k) {
    out.terms_px[k] += change(data::kFirstTerm + static_cast<Eigen::Index>(k));
  }
  return out;
}

}  // namespace unfurl::measure
