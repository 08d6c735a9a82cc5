#pragma once

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <string>
#include <vector>

#include "base/statistics.h"
#include "base/worker_pool.h"
#include "correlate/fit/fit.h"
#include "study/scene_model.h"
#include "tests/correlate/two_link.h"
#include "tests/source_dir.h"

namespace unfurl::correlate {

// The shipped deployment, four segments a beam, hung from strings: data and fit by one and the same
// simulator, so that what is looked at is the fit and not the mesh.
struct Deployment {
  enum Unknown { kClearance, kDamping, kStiffness, kRestitution, kHinge };
  static std::vector<std::string> Marks() { return {"mark1", "mark1b", "mark2", "mark3"}; }

  // One value for all latches, beams, springs, hinges.
  static study::SceneModelOptions Binding(const std::vector<Unknown>& unknown, double rtol) {
    study::SceneModelOptions options;
    options.scene =
        std::string(UNFURL_SOURCE_DIR) + "/data/sets/deployment/scene_suspension_4.toml";
    options.rtol = rtol;
    for (Unknown which : unknown) {
      std::vector<std::string> keys;
      for (int i = 1; i <= 4; ++i) {
        switch (which) {
          case kClearance:
            keys.push_back(fmt::format("joint.joint{}.latch.theta_a", i));
            keys.push_back(fmt::format("joint.joint{}.latch.theta_b", i));
            break;
          case kDamping:
            keys.push_back(fmt::format("beam.beam{}.damping", i));
            break;
          case kStiffness:
            keys.push_back(fmt::format("joint.joint{}.spring.stiffness", i));
            break;
          case kRestitution:
            if (i == 1) keys.push_back("contact.lock.restitution");
            break;
          case kHinge:
            keys.push_back(fmt::format("joint.joint{}.damper.damping", i));
            break;
        }
      }
      options.keys.push_back(keys);
    }
    return options;
  }

  static std::vector<Parameter> Parameters(const std::vector<Unknown>& unknown) {
    std::vector<Parameter> all;
    for (Unknown which : unknown) {
      Parameter p;
      p.log = which != kRestitution;
      switch (which) {
        case kClearance:
          p.name = "clearance", p.unit = "rad", p.start = 0.0055, p.low = 0.002, p.high = 0.02;
          break;
        case kDamping:
          p.name = "beam damping", p.unit = "s", p.start = 2e-4, p.low = 2e-5, p.high = 2e-3;
          break;
        case kStiffness:
          p.name = "stiffness", p.unit = "N m/rad", p.start = 0.218, p.low = 0.15, p.high = 0.3;
          break;
        case kRestitution:
          p.name = "restitution", p.unit = "1", p.start = 0.8, p.low = 0.3, p.high = 0.98;
          break;
        case kHinge:
          p.name = "hinge damping", p.unit = "N m s/rad", p.start = 3e-3, p.low = 5e-4,
          p.high = 2e-2;
          break;
      }
      all.push_back(p);
    }
    return all;
  }

  static Trial Recording(double duration, double sigma = 2e-4) {
    Trial trial = TiltedTrial();
    trial.duration = duration;
    trial.step = 0.005;
    trial.sigma = sigma;
    return trial;
  }
};

// Optics that are wrong in a smooth way: a random field of displacements in the model's plane over
// `length` [m], `rms` of the vector [m]. `each` directions for either axis: those of most variance
// over the places that the marks come by, scaled to the rms there.
class SmoothOptics {
 public:
  SmoothOptics(const Observations& data, const Pose& X_WM, double rms, double length, int each) {
    const Eigen::Matrix3d R = X_WM.linear();
    std::vector<Eigen::Vector3d> places;
    constexpr std::size_t kEvery = 8;
    for (const MarkSeries& m : data.marks) {
      for (std::size_t i = 0; i < m.size(); i += kEvery) {
        places.push_back(m.p.col(static_cast<Eigen::Index>(i)));
      }
    }
    const auto n = static_cast<Eigen::Index>(places.size());
    auto kernel = [length](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
      return std::exp(-0.5 * (a - b).squaredNorm() / (length * length));
    };
    Eigen::MatrixXd K(n, n);
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = 0; j < n; ++j) {
        K(i, j) = kernel(places[static_cast<std::size_t>(i)], places[static_cast<std::size_t>(j)]);
      }
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(K);
    const Eigen::MatrixXd basis =
        eigen.eigenvectors().rightCols(each) *
        eigen.eigenvalues().tail(each).cwiseSqrt().cwiseInverse().asDiagonal();
    double sum = 0.0, count = 0.0;
    for (const MarkSeries& m : data.marks) {
      Eigen::Matrix3Xd F = Eigen::Matrix3Xd::Zero(3, m.p.cols() * 2 * each);
      for (Eigen::Index i = 0; i < m.p.cols(); ++i) {
        Eigen::RowVectorXd row(n);
        for (Eigen::Index j = 0; j < n; ++j) {
          row(j) = kernel(m.p.col(i), places[static_cast<std::size_t>(j)]);
        }
        const Eigen::RowVectorXd shape = row * basis;
        for (int d = 0; d < each; ++d) {
          F.col(i * 2 * each + d) = R.col(0) * shape(d);
          F.col(i * 2 * each + each + d) = R.col(1) * shape(d);
        }
        sum += 2.0 * shape.squaredNorm();
        count += 1.0;
      }
      shared_.push_back(std::move(F));
    }
    const double scale = rms / std::sqrt(sum / count);
    for (Eigen::Matrix3Xd& F : shared_) F *= scale;
    rank_ = 2 * each;
  }

  // Adds one draw to the marks; `claimed`: and the directions to what the tracks say of themselves.
  void Apply(bool claimed, Rng& rng, Observations* data) const {
    Eigen::VectorXd z(rank_);
    for (int j = 0; j < rank_; ++j) z(j) = rng.Normal();
    for (std::size_t m = 0; m < data->marks.size(); ++m) {
      MarkSeries& series = data->marks[m];
      for (Eigen::Index i = 0; i < series.p.cols(); ++i) {
        series.p.col(i) += shared_[m].middleCols(i * rank_, rank_) * z;
      }
      if (claimed) series.shared = shared_[m];
    }
    if (claimed) data->shared_rank = rank_;
  }

 private:
  std::vector<Eigen::Matrix3Xd> shared_;
  int rank_ = 0;
};

}  // namespace unfurl::correlate
