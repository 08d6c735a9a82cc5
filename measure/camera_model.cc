#include "measure/camera_model.h"

#include <cmath>

#include "base/pose.h"

namespace unfurl::measure {
namespace {

constexpr double kNearest = 0.05;  // of a point in front of the slit, and of the far centre [m]

// The odd and even terms of data::kCameraTerms, and their slopes by x and by y.
struct Terms {
  std::array<double, 10> value, dx, dy;
};

Terms Evaluate(double x, double y) {
  const double x2 = x * x, y2 = y * y, x3 = x2 * x, y3 = y2 * y, x4 = x2 * x2, y4 = y2 * y2;
  return {{x3, x * y2, x4 * x, x3 * y2, x * y4, x2, x * y, y2, x2 * y, y3},
          {3.0 * x2, y2, 5.0 * x4, 3.0 * x2 * y2, y4, 2.0 * x, y, 0.0, 2.0 * x * y, 0.0},
          {0.0, 2.0 * x * y, 0.0, 2.0 * x3 * y, 4.0 * x * y3, 0.0, x, 2.0 * y, x2, 3.0 * y2}};
}

bool InFront(const data::RigCamera& camera, const Eigen::Vector3d& p_C) {
  return p_C.z() > kNearest && p_C.z() + camera.e > kNearest;
}

}  // namespace

bool Project(const data::RigCamera& camera, const Eigen::Vector3d& p_W, double* u_px) {
  const Eigen::Vector3d p_C = camera.R_CW * (p_W - camera.p_WC);
  if (!InFront(camera, p_C)) return false;
  const double x = p_C.x() / p_C.z(), y = p_C.y() / (p_C.z() + camera.e);
  const double x2 = x * x, y2 = y * y;
  const auto& t = camera.terms_px;
  const double odd =
      x * (camera.f_px + x2 * (t[0] + t[2] * x2 + t[3] * y2) + y2 * (t[1] + t[4] * y2));
  const double even = t[5] * x2 + t[6] * x * y + y2 * (t[7] + t[9] * y) + t[8] * x2 * y;
  *u_px = camera.u0_px + odd + even;
  return true;
}

bool Project(const data::RigCamera& camera, const Eigen::Vector3d& p_W, Projection* out) {
  const Eigen::Vector3d p_C = camera.R_CW * (p_W - camera.p_WC);
  if (!InFront(camera, p_C)) return false;
  const double inverse_z = 1.0 / p_C.z(), inverse_far = 1.0 / (p_C.z() + camera.e);
  const double x = p_C.x() * inverse_z, y = p_C.y() * inverse_far;
  const Terms terms = Evaluate(x, y);

  double u = camera.u0_px + camera.f_px * x, du_dx = camera.f_px, du_dy = 0.0;
  for (std::size_t k = 0; k < terms.value.size(); ++k) {
    u += camera.terms_px[k] * terms.value[k];
    du_dx += camera.terms_px[k] * terms.dx[k];
    du_dy += camera.terms_px[k] * terms.dy[k];
    out->du_dc(9 + static_cast<Eigen::Index>(k)) = terms.value[k];
  }
  out->u_px = u;
  const Eigen::RowVector3d du_dp_C(du_dx * inverse_z, du_dy * inverse_far,
                                   -du_dx * x * inverse_z - du_dy * y * inverse_far);
  out->du_dp = du_dp_C * camera.R_CW;
  out->du_dc.head<3>() = -du_dp_C * Skew(p_C);  // Exp(w) p_C = p_C - [p_C]x w to first order
  out->du_dc.segment<3>(3) = -out->du_dp;
  out->du_dc(6) = x;
  out->du_dc(7) = 1.0;
  out->du_dc(8) = -du_dy * y * inverse_far;
  return true;
}

data::RigCamera Perturbed(const data::RigCamera& camera,
                          const Eigen::Matrix<double, data::kCameraParameters, 1>& change) {
  data::RigCamera out = camera;
  out.R_CW = RotationFromVector(change.head<3>()) * camera.R_CW;
  out.p_WC += change.segment<3>(3);
  out.f_px += change(6);
  out.u0_px += change(7);
  out.e += change(8);
  for (std::size_t k = 0; k < out.terms_px.size(); ++k) {
    out.terms_px[k] += change(9 + static_cast<Eigen::Index>(k));
  }
  return out;
}

}  // namespace unfurl::measure
