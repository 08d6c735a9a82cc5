#include "tests/measure/fixtures.h"

#include <cmath>

#include "base/dense.h"
#include "base/random.h"
#include "tests/source_dir.h"

namespace unfurl::measure {

data::Lab ShippedLab(const std::vector<std::string>& overrides) {
  return data::ReadLab(UNFURL_SOURCE_DIR "/data/sets/deployment/lab.toml", overrides);
}

data::RigCamera FitCamera(const LensCamera& camera, const Eigen::Matrix3Xd& points,
                          double* rms_px) {
  data::RigCamera fit;
  fit.name = camera.name;
  fit.pixels = camera.sensor.pixels;
  fit.R_CW = camera.X_WC.linear().transpose();
  fit.p_WC = camera.X_WC.translation();
  fit.f_px = 31.4e-3 / camera.sensor.pitch;
  fit.u0_px = 0.5 * (camera.sensor.pixels - 1);
  fit.e = 0.038;
  std::vector<double> u;
  std::vector<Eigen::Vector3d> seen;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    SpotLight spot;
    if (!TraceSpot(camera, points.col(i), &spot)) continue;
    if (spot.centre_px < 10.0 || spot.centre_px > camera.sensor.pixels - 11.0) continue;
    u.push_back(spot.centre_px);
    seen.emplace_back(points.col(i));
  }
  const auto n = static_cast<Eigen::Index>(u.size());
  Eigen::VectorXd r(n);
  for (int step = 0; step < 20; ++step) {
    Eigen::MatrixXd J(n, data::kCameraParameters);
    for (Eigen::Index i = 0; i < n; ++i) {
      Projection here;
      Project(fit, seen[static_cast<std::size_t>(i)], &here);
      J.row(i) = here.du_dc;
      r(i) = u[static_cast<std::size_t>(i)] - here.u_px;
    }
    const Eigen::VectorXd scale = J.colwise().norm().cwiseMax(1e-12).cwiseInverse();
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> qr;
    qr.setThreshold(1e-7);
    qr.compute(J * scale.asDiagonal());
    const Eigen::Matrix<double, data::kCameraParameters, 1> change =
        scale.asDiagonal() * qr.solve(r);
    fit = Perturbed(fit, change);
  }
  if (rms_px != nullptr) *rms_px = std::sqrt(r.squaredNorm() / static_cast<double>(n));
  return fit;
}

Eigen::Matrix3Xd RandomPoints(const Eigen::Vector3d& low, const Eigen::Vector3d& high, int n,
                              std::uint64_t seed) {
  Rng rng(seed);
  Eigen::Matrix3Xd points(3, n);
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) points(k, i) = rng.Uniform(low(k), high(k));
  }
  return points;
}

data::Rig FitRig(const VirtualRig& truth, const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  data::Rig rig;
  const Eigen::Matrix3Xd points = RandomPoints(low, high, 800, 11);
  for (const LensCamera& camera : truth.cameras) rig.cameras.push_back(FitCamera(camera, points));
  const auto size = static_cast<Eigen::Index>(rig.cameras.size()) * data::kCameraParameters;
  rig.covariance = Eigen::MatrixXd::Zero(size, size);
  rig.volume_low = low;
  rig.volume_high = high;
  return rig;
}

const data::Rig& ShippedRig() {
  static const data::Rig rig = [] {
    const data::Lab lab = ShippedLab();
    return FitRig(MakeVirtualRig(lab), lab.volume_low, lab.volume_high);
  }();
  return rig;
}

data::Run FourMarks() {
  data::Run run;
  run.marks = {"mark1", "mark1b", "mark2", "mark3"};
  for (const std::string& mark : run.marks) {
    for (const char* axis : {".x", ".y", ".vx", ".vy"}) {
      run.quantities.push_back({mark + axis, axis[1] == 'v' ? "m/s" : "m", ""});
      run.columns.emplace_back();
    }
  }
  return run;
}

data::Run SwingingRun(double duration) {
  data::Run run = FourMarks();
  const int n = static_cast<int>(std::lround(duration * 1000.0));
  for (int i = 0; i <= n; ++i) {
    const double t = i * 1e-3;
    run.t.push_back(t);
    for (std::size_t m = 0; m < run.marks.size(); ++m) {
      const double reach = 0.15 + 0.3 * static_cast<double>(m);
      const double rate = 2.0 - 0.3 * static_cast<double>(m);
      const double phase = static_cast<double>(m);
      const double x = 0.8 + reach * std::sin(rate * t + phase);
      const double y = 0.2 + 0.6 * reach * std::cos(rate * t + phase);
      const double vx = reach * rate * std::cos(rate * t + phase);
      const double vy = -0.6 * reach * rate * std::sin(rate * t + phase);
      const double values[] = {x, y, vx, vy};
      for (std::size_t k = 0; k < 4; ++k) run.columns[4 * m + k].push_back(values[k]);
    }
  }
  return run;
}

}  // namespace unfurl::measure
