#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <string>
#include <vector>

#include "base/pose.h"
#include "base/random_vector.h"
#include "calib/observations.h"
#include "data/rig.h"
#include "measure/camera_model.h"

// Rigs and surveys made by the fitted model itself, for statements about efficiency, coverage and
// convergence; what the model cannot do is tested with rays through glass elsewhere.
namespace unfurl::calib::testing {

inline constexpr int kPixels = 2160;

struct RigOptions {
  int cameras = 4;
  double distance = 3.2;     // from the volume's middle [m]
  double f_px = 2214.0;      // 31 mm over 14 um
  double f_spread = 0.0;     // relative, uniform
  double pose_error = 0.03;  // of mounting [rad], [m] per axis, normal
  double distortion = 1.0;   // scale of the terms and of e
};

// A camera at `place` that looks at `target`, its lens axis turned by `roll` from the vertical.
inline data::RigCamera LookAt(const Eigen::Vector3d& place, const Eigen::Vector3d& target,
                              double roll) {
  const Eigen::Vector3d Z = (target - place).normalized();
  const Eigen::Vector3d up =
      std::abs(Z.z()) < 0.9 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitX();
  const Eigen::Vector3d X0 = up.cross(Z).normalized(), Y0 = Z.cross(X0);
  const Eigen::Vector3d X = std::cos(roll) * X0 + std::sin(roll) * Y0;
  data::RigCamera camera;
  camera.R_CW.row(0) = X;
  camera.R_CW.row(1) = Z.cross(X);
  camera.R_CW.row(2) = Z;
  camera.p_WC = place;
  camera.pixels = kPixels;
  return camera;
}

// The same, the lens axis turned by `roll` from the world's x axis, as in a laboratory's file.
inline data::RigCamera LookAtFromX(const Eigen::Vector3d& place, const Eigen::Vector3d& target,
                                   double roll) {
  const Eigen::Vector3d Z = (target - place).normalized();
  const Eigen::Vector3d across = (Eigen::Vector3d::UnitX() - Z.x() * Z).normalized();
  const Eigen::Vector3d Y = std::cos(roll) * across + std::sin(roll) * Z.cross(across);
  data::RigCamera camera;
  camera.R_CW.row(0) = Y.cross(Z);
  camera.R_CW.row(1) = Y;
  camera.R_CW.row(2) = Z;
  camera.p_WC = place;
  camera.pixels = kPixels;
  return camera;
}

// Four (or more) cameras as in the shipped laboratory: at the corners of a square, lens axes
// alternately at +45 and -45 degrees from the world's x axis, so that any three fix a point; with
// the distortion of a plano-convex cylinder behind a slit, all of it disturbed at random.
inline std::vector<data::RigCamera> MakeRig(const RigOptions& options, Rng rng) {
  std::vector<data::RigCamera> cameras;
  for (int j = 0; j < options.cameras; ++j) {
    const double turn = 2.0 * M_PI * (j + 0.5) / options.cameras;
    const double side = std::sqrt(2.0);
    const Eigen::Vector3d place(side * std::cos(turn), side * std::sin(turn),
                                std::sqrt(options.distance * options.distance - 2.0));
    data::RigCamera camera =
        LookAtFromX(place, Eigen::Vector3d::Zero(), (j % 2 == 0 ? 1.0 : -1.0) * M_PI / 4.0);
    const auto error = [&] { return options.pose_error * rng.Normal(); };
    camera.R_CW = RotationFromVector({error(), error(), error()}) * camera.R_CW;
    camera.p_WC += options.pose_error * NormalVector(&rng);
    camera.name = "c" + std::to_string(j + 1);
    camera.f_px = options.f_px * (1.0 + options.f_spread * rng.Uniform(-1.0, 1.0));
    camera.u0_px = 1079.5 + 10.0 * rng.Normal();
    camera.e = options.distortion * (0.03 + 0.005 * rng.Normal());
    const double f = options.distortion * camera.f_px;
    const double size[10] = {0.15, 0.6, 0.05, 0.1, 0.3, 0.005, 0.005, 0.005, 0.01, 0.005};
    for (std::size_t k = 0; k < 10; ++k) {
      camera.terms_px[k] = f * size[k] * (k < 5 ? 1.0 + 0.2 * rng.Normal() : rng.Normal());
    }
    cameras.push_back(camera);
  }
  return cameras;
}

inline Eigen::Matrix3Xd PointsInCube(int n, double half_side, Rng rng) {
  Eigen::Matrix3Xd p(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) p(k, i) = rng.Uniform(-half_side, half_side);
  }
  return p;
}

// What cameras would read of true points, and the survey of those points, both with normal noise.
inline Observations Observe(const std::vector<data::RigCamera>& cameras, const Eigen::Matrix3Xd& p,
                            double survey_sigma, double reading_sigma_px, Rng rng) {
  Observations out;
  out.p = p;
  for (const auto& camera : cameras) {
    out.cameras.push_back(camera.name);
    out.pixels.push_back(camera.pixels);
  }
  for (Eigen::Index i = 0; i < p.cols(); ++i) {
    out.ids.push_back("p" + std::to_string(i + 1));
    out.cov.push_back(survey_sigma * survey_sigma * Eigen::Matrix3d::Identity());
    for (int k = 0; k < 3; ++k) out.p(k, i) += survey_sigma * rng.Normal();
    for (std::size_t j = 0; j < cameras.size(); ++j) {
      double u = 0.0;
      const double noise = reading_sigma_px * rng.Normal();
      if (!measure::Project(cameras[j], p.col(i), &u)) continue;
      if (u < 0.0 || u > cameras[j].pixels - 1) continue;
      out.readings.push_back(
          {static_cast<int>(i), static_cast<int>(j), u + noise, reading_sigma_px});
    }
  }
  return out;
}

}  // namespace unfurl::calib::testing
