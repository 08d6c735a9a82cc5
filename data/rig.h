#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <string>
#include <vector>

#include "data/lens.h"
#include "data/provenance.h"

namespace unfurl::data {

// One calibrated camera. Camera frame C: origin at the slit's centre, X along the sensor row
// (growing u), Z along the optical axis towards the scene, Y = Z x X along the lens axis.
// With (X, Y, Z) the point in C, x = X / Z and y = Y / (Z + e):
//   u = u0 + image(x, y; f, terms) by its lens model (data/lens.h), in px.
// [docs/physics-optics.md, the two-centre model]
struct RigCamera {
  std::string name;
  int pixels = 0;  // active ones: readings lie from 0 to pixels - 1
  LensModel lens = LensModel::kRectilinear;
  Eigen::Matrix3d R_CW = Eigen::Matrix3d::Identity();  // from W to C [-]
  Eigen::Vector3d p_WC = Eigen::Vector3d::Zero();      // the slit's centre in W [m]
  double f_px = 0.0;                                   // image scale [px]
  double u0_px = 0.0;                                  // reading on the optical axis [px]
  double e = 0.0;                                      // distance between the two centres [m]
  std::array<double, kLensTerms> terms_px{};           // in the order of LensNames::terms [px]
  // Its own model-error floor, added in quadrature to each reading's sigma [px]; negative: the
  // rig's.
  double floor_px = -1.0;
};

// Parameters of one camera, in this order, wherever a covariance or a Jacobian is laid out:
// 0-2 rotation w, R_CW <- Exp(w) R_CW [rad]; 3-5 p_WC [m]; 6 f [px]; 7 u0 [px]; 8 e [m];
// 9-30 terms [px].
inline constexpr int kFirstTerm = 9;
inline constexpr int kCameraParameters = kFirstTerm + static_cast<int>(kLensTerms);

// The calibrated cameras with their joint uncertainty, and what the calibration says of itself.
struct Rig {
  std::vector<RigCamera> cameras;  // c
  // Joint covariance of all cameras' parameters, 31 c x 31 c; zero rows for what was held fixed
  // [products of the units of kCameraParameters].
  Eigen::MatrixXd covariance;
  double model_floor_px = 0.0;  // the largest of the cameras' floors [px]
  // The box of the surveyed points, in W [m]: outside it the camera model extrapolates.
  Eigen::Vector3d volume_low = Eigen::Vector3d::Zero();
  Eigen::Vector3d volume_high = Eigen::Vector3d::Zero();
  // Checks by name with unit in the name ("held_out_rms [m]"), and the verdict in words.
  std::map<std::string, double> checks;
  std::string verdict;               // "good", "usable with care", "do not use"
  std::vector<std::string> reasons;  // why
};

// What is added in quadrature to the sigma of a reading of that camera [px].
inline double FloorOf(const Rig& rig, std::size_t camera) {
  const double own = rig.cameras[camera].floor_px;
  return own >= 0.0 ? own : rig.model_floor_px;
}

inline constexpr char kRigSchema[] = "unfurl/rig";
inline constexpr int kRigVersion = 3;  // 2: pixels and lens of each camera; 3: 22 terms

// Both throw Error: for a full disk or a refused path, for a file that is none or contradicts
// itself.
void WriteRig(const std::string& path, const Rig& rig, const Provenance& provenance);
Rig ReadRig(const std::string& path);

}  // namespace unfurl::data
