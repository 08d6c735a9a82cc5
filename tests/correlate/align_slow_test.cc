// Time offset and clock drift against the Cramer-Rao bound, 1000 draws of noise.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "base/statistics.h"
#include "base/worker_pool.h"
#include "correlate/align/align.h"
#include "tests/correlate/two_link.h"

namespace unfurl::correlate::align_slow_test {
namespace {

constexpr std::size_t kDraws = 1000;
constexpr double kOverBound = 1.1;  // issue: standard error over its bound, at most

// The whole Fisher matrix of rotation, shift, offset and drift by differences of the closed form:
// nothing of the registration's own.
Eigen::VectorXd Bound(const Observations& record, const Trial& trial, double drift, double pivot) {
  auto position = [&](const Eigen::VectorXd& u, const std::string& mark, double t) {
    const double model = pivot + (t - pivot) / (1.0 + drift + u(7)) - trial.offset - u(6);
    const Eigen::Vector3d y = TwoLink::Position(TwoLink::Truth(), mark, std::max(0.0, model));
    return Eigen::Vector3d(RotationFromVector(u.head<3>()) * (trial.X_WM * y) + u.segment<3>(3));
  };
  Eigen::MatrixXd fisher = Eigen::MatrixXd::Zero(8, 8);
  for (const MarkSeries& m : record.marks) {
    for (const double t : m.t) {
      Eigen::Matrix<double, 3, 8> J;
      for (Eigen::Index j = 0; j < 8; ++j) {
        constexpr double kStep = 1e-6;
        Eigen::VectorXd up = Eigen::VectorXd::Zero(8), down = up;
        up(j) = kStep;
        down(j) = -kStep;
        J.col(j) = (position(up, m.name, t) - position(down, m.name, t)) / (2.0 * kStep);
      }
      fisher += J.transpose() * J / (trial.sigma * trial.sigma);
    }
  }
  return Eigen::MatrixXd(fisher.inverse()).diagonal().cwiseSqrt();
}

TEST(AlignRepeats, OffsetAndDriftScatterByTheirBound) {
  const SampledModel reference(TwoLink(), TwoLink::Truth(), TwoLink::Marks(), 0.0, 4.2, 1e-3);
  const Trial trial = TiltedTrial();
  constexpr double kDrift = 2e-4;
  AlignOptions options;
  options.registration.fit_drift = true;
  std::vector<double> offset(kDraws), drift(kDraws), offset_sigma(kDraws), drift_sigma(kDraws);
  Observations one;
  double pivot = 0.0;
  auto draw = [&](std::size_t i) {
    Rng rng = Rng(31).Stream("draw", i);
    Observations o = Record(TwoLink(), TwoLink::Truth(), TwoLink::Marks(), trial, rng);
    const double middle = 0.5 * (o.Start() + o.End());
    for (MarkSeries& m : o.marks) {
      for (double& t : m.t) t = middle + (t - middle) * (1.0 + kDrift);
    }
    return o;
  };
  one = draw(0);
  pivot = 0.5 * (one.Start() + one.End());
  std::vector<std::uint8_t> good(kDraws, 0);
  ParallelFor(kDraws, 0, [&](std::size_t i) {
    const Alignment a = Align(draw(i), reference, options);
    good[i] = a.Usable() ? 1 : 0;
    offset[i] = a.at.offset - trial.offset;
    drift[i] = a.drift - kDrift;
    offset_sigma[i] = a.Sigma("time offset");
    drift_sigma[i] = a.Sigma("clock drift");
  });
  EXPECT_EQ(std::count(good.begin(), good.end(), 1), static_cast<std::ptrdiff_t>(kDraws));
  const Eigen::VectorXd bound = Bound(one, trial, kDrift, pivot);
  fmt::print(
      "offset: bound {:.3g} s, RMSE over it {:.3f}, claimed over it {:.3f}; drift: bound {:.3g}, "
      "RMSE over it {:.3f}, claimed over it {:.3f}\n",
      bound(6), Rms(offset) / bound(6), Mean(offset_sigma) / bound(6), bound(7),
      Rms(drift) / bound(7), Mean(drift_sigma) / bound(7));
  EXPECT_LT(Rms(offset), kOverBound * bound(6));
  EXPECT_LT(Rms(drift), kOverBound * bound(7));
  EXPECT_LT(Mean(offset_sigma), kOverBound * bound(6));
  EXPECT_LT(Mean(drift_sigma), kOverBound * bound(7));
  // What is claimed is no less than what it scatters: RMS of 1000 errors is known to 2.2%.
  EXPECT_GT(Mean(offset_sigma), Rms(offset) / (1.0 + 3.0 * 0.022));
  EXPECT_GT(Mean(drift_sigma), Rms(drift) / (1.0 + 3.0 * 0.022));
}

}  // namespace
}  // namespace unfurl::correlate::align_slow_test
