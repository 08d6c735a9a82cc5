#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "calib/calibrate.h"
#include "measure/camera_model.h"
#include "measure/triangulate.h"
#include "tests/calib/synthetic.h"

namespace unfurl::calib::testing {

// How far points found with an estimated rig are from where they truly are, when the true cameras'
// noise-free readings are given: what the calibration alone does. Points that four cameras see.
struct TrueErrors {
  std::vector<Eigen::Vector3d> error;      // [m]
  std::vector<Eigen::Matrix3d> predicted;  // by the rig's covariance [m^2]

  double Rms() const {
    double squares = 0.0;
    for (const auto& e : error) squares += e.squaredNorm();
    return std::sqrt(squares / static_cast<double>(error.size()));
  }
  double PredictedRms() const {
    double squares = 0.0;
    for (const auto& C : predicted) squares += C.trace();
    return std::sqrt(squares / static_cast<double>(predicted.size()));
  }
};

inline TrueErrors ErrorsOf(const data::Rig& rig, const std::vector<data::RigCamera>& truth,
                           const Eigen::Matrix3Xd& points) {
  const measure::Triangulator triangulator(rig, {.residual_level = 1e-12});
  Eigen::Matrix3Xd F(3, triangulator.shared_rank());
  TrueErrors out;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    std::vector<double> u(truth.size()), s(truth.size(), 0.05);
    bool all = true;
    for (std::size_t j = 0; j < truth.size(); ++j) {
      all = all && measure::Project(truth[j], points.col(i), &u[j]) && u[j] >= 0.0 &&
            u[j] <= kPixels - 1.0;
    }
    if (!all) continue;
    const measure::PointSolution found = triangulator.Solve(u, s, points.col(i));
    if (found.outcome != measure::PointOutcome::kSolved) continue;
    triangulator.SharedFactor(found, s, F);
    out.error.push_back(found.p - points.col(i));
    out.predicted.emplace_back(F * F.transpose());
  }
  return out;
}

// A survey of the usual kind: points in the shipped volume, 0.3 mm, 0.05 px.
struct Study {
  std::vector<data::RigCamera> truth;
  Eigen::Matrix3Xd points;
  Observations data;
};

inline Study MakeStudy(std::uint64_t seed, int points = 200, const RigOptions& options = {}) {
  const Rng rng(seed);
  Study study;
  study.truth = MakeRig(options, rng.Stream("rig"));
  study.points = PointsInCube(points, 1.1, rng.Stream("points"));
  study.data = Observe(study.truth, study.points, 3e-4, 0.05, rng.Stream("noise"));
  return study;
}

// What could be found of gross errors with the true cameras and sigmas, which nobody has.
inline Weighting BestGross(const Observations& data, const std::vector<data::RigCamera>& cameras) {
  Weighting best = EqualWeighting(data, 0.0);
  BundleState truth{cameras, data.p};
  GrossOptions options;
  for (int round = 0; round < 5; ++round) {
    const GrossChoice choice = ChooseGross(data, options, &best, &truth);
    options.reading_share =
        std::clamp(choice.reading_share, options.least_share, options.most_share);
    options.survey_share = std::clamp(choice.survey_share, options.least_share, options.most_share);
  }
  return best;
}

inline Eigen::Matrix3Xd CheckPoints(std::uint64_t seed, int n = 200) {
  return PointsInCube(n, 0.9, Rng(seed).Stream("check points"));
}

}  // namespace unfurl::calib::testing
