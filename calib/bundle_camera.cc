#include "calib/bundle_camera.h"

#include <algorithm>
#include <cmath>

namespace unfurl::calib {

BundleUnits UnitsOf(const Observations& data, const BundleState& state) {
  const Eigen::Matrix3Xd centred = data.p.colwise() - data.p.rowwise().mean();
  BundleUnits units;
  const double size = std::sqrt(centred.squaredNorm() / static_cast<double>(data.points()));
  if (size > 0.0) units.length = size;
  for (const data::RigCamera& camera : state.cameras) {
    units.row = std::max(units.row, static_cast<double>(camera.pixels));
  }
  return units;
}

CameraBlock Pack(const data::RigCamera& camera, const BundleUnits& units) {
  CameraBlock x;
  for (int k = 0; k < 9; ++k) x[static_cast<std::size_t>(k)] = camera.R_CW(k / 3, k % 3);
  for (int k = 0; k < 3; ++k) x[static_cast<std::size_t>(9 + k)] = camera.p_WC(k);
  x[12] = camera.f_px;
  x[13] = camera.u0_px;
  x[14] = camera.e;
  std::copy(camera.terms_px.begin(), camera.terms_px.end(), x.begin() + kFirst);
  for (int k = 9; k < kAmbient; ++k) x[static_cast<std::size_t>(k)] /= units.Of(k);
  return x;
}

void Unpack(const double* x, const BundleUnits& units, data::RigCamera* camera) {
  camera->R_CW = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(x);
  camera->p_WC = units.length * Eigen::Map<const Eigen::Vector3d>(x + 9);
  camera->f_px = units.row * x[12];
  camera->u0_px = units.row * x[13];
  camera->e = units.length * x[14];
  for (std::size_t k = 0; k < data::kLensTerms; ++k) {
    camera->terms_px[k] = units.row * x[kFirst + static_cast<int>(k)];
  }
}

}  // namespace unfurl::calib
