// How certain an association is, against the same weights by a second formulation: all subsets of a
// mark's readings, each with the density of its readings jointly, N(u; expected, J P J' + R), in
// place of filters and Laplace's integral.

#include "measure/associate.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "measure/camera_model.h"
#include "tests/measure/fixtures.h"

namespace unfurl::measure::associate_test {
namespace {

constexpr double kSigma = 0.05;  // of a reading [px]
constexpr double kFloor = 0.12;  // of the cameras [px]
constexpr double kRowPx = 2160.0;  // of the fixture's cameras [px]
constexpr double kPlace = 1e-3;  // of where the mark is expected [m]

struct Subset {
  double log_weight = 0.0;
  Eigen::Vector3d p;
  Eigen::Matrix3d cov;
  int readings = 0;
};

// Every subset of the readings of one mark expected at `mean`.
std::vector<Subset> Subsets(const Triangulator& triangulator, const Eigen::Vector3d& mean,
                            const std::vector<double>& u, const AssociateOptions& options) {
  const std::size_t n = u.size();
  std::vector<Subset> out;
  for (unsigned set = 0; set < (1U << n); ++set) {
    Subset s;
    std::vector<std::size_t> used;
    for (std::size_t c = 0; c < n; ++c) {
      if ((set >> c & 1U) == 0) {
        s.log_weight += std::log(options.miss);
        continue;
      }
      used.push_back(c);
      s.log_weight += std::log(1.0 - options.miss) - std::log(options.clutter / kRowPx);
    }
    const auto k = static_cast<Eigen::Index>(used.size());
    s.readings = static_cast<int>(k);
    Eigen::MatrixXd J(k, 3);
    Eigen::VectorXd left(k);
    for (Eigen::Index i = 0; i < k; ++i) {
      Projection at;
      EXPECT_TRUE(
          Project(triangulator.rig().cameras[used[static_cast<std::size_t>(i)]], mean, &at));
      J.row(i) = at.du_dp;
      left(i) = u[used[static_cast<std::size_t>(i)]] - at.u_px;
    }
    const double variance = kSigma * kSigma + kFloor * kFloor, place = kPlace * kPlace;
    const Eigen::MatrixXd S =
        place * J * J.transpose() + variance * Eigen::MatrixXd::Identity(k, k);
    if (k > 0) {
      s.log_weight -= 0.5 * (static_cast<double>(k) * std::log(2.0 * M_PI) +
                             std::log(S.determinant()) + left.dot(S.fullPivLu().solve(left)));
    }
    const Eigen::Matrix3d information = J.transpose() * J / variance;
    if (k >= 3) {  // the readings' own point
      std::vector<double> readings(n, NAN), sigmas(n, kSigma);
      for (const std::size_t c : used) readings[c] = u[c];
      const PointSolution point = triangulator.Solve(readings, sigmas, mean);
      if (point.outcome != PointOutcome::kSolved) continue;  // four that do not meet
      s.cov = information.inverse();
      s.p = mean + s.cov * (J.transpose() * left / variance);
    } else {
      s.cov = (information + Eigen::Matrix3d::Identity() / place).inverse();
      s.p = mean + s.cov * (J.transpose() * left / variance);
    }
    out.push_back(s);
  }
  return out;
}

TEST(Associate, CertaintyIsTheShareOfTheWeight) {
  data::Rig rig = ShippedRig();
  for (data::RigCamera& camera : rig.cameras) camera.floor_px = kFloor;
  const Triangulator triangulator(rig);
  AssociateOptions options;
  options.miss = 0.03;
  const std::size_t n = rig.cameras.size();
  const Eigen::Vector3d place = triangulator.centre() + Eigen::Vector3d(0.1, -0.05, 0.08);
  const auto mark_at = [](const Eigen::Vector3d& p, double sigma) {
    Associator::Mark mark;
    mark.known = mark.followed = true;
    mark.expected.count = 1;
    mark.expected.mean[0] = p;
    mark.expected.variance[0] = sigma * sigma;
    mark.expected.weight[0] = 1.0;
    return mark;
  };
  // A second mark that nothing shows: while one is lit alone, spots that are not taken count in
  // another way.
  const std::vector<Associator::Mark> marks = {
      mark_at(place, kPlace), mark_at(place + Eigen::Vector3d(0.3, 0.3, -0.3), 1e-6)};
  int doubtful = 0;
  for (double displaced = -5.0; displaced < 5.1; displaced += 0.25) {
    std::vector<double> u(n);
    std::vector<std::vector<Candidate>> line(n);
    for (std::size_t c = 0; c < n; ++c) {
      EXPECT_TRUE(Project(rig.cameras[c], place, &u[c]));
      u[c] += 0.05 * std::cos(static_cast<double>(c)) + (c == 1 ? displaced : 0.0);
      line[c] = {{u[c], kSigma}};
    }
    const std::vector<std::span<const Candidate>> spans(line.begin(), line.end());
    Associator associator(triangulator, options);
    std::vector<Association> found;
    associator.Associate(spans, marks, {}, &found);

    const std::vector<Subset> subsets = Subsets(triangulator, place, u, options);
    const auto best = std::max_element(
        subsets.begin(), subsets.end(),
        [](const Subset& a, const Subset& b) { return a.log_weight < b.log_weight; });
    double total = 0.0, agree = 0.0;
    for (const Subset& s : subsets) {
      const double weight = std::exp(s.log_weight - best->log_weight);
      total += weight;
      // Points within three sigmas of their difference, and 50 um, are no alternatives; "not seen"
      // is one.
      const bool same =
          s.readings > 0 &&
          (s.p - best->p).norm() < 5e-5 + 3.0 * std::sqrt(s.cov.trace() + best->cov.trace());
      if (same) agree += weight;
    }
    // The cameras' curvature over the place's sigma.
    EXPECT_NEAR(found[0].certainty, agree / total, 0.02) << displaced;
    doubtful += agree / total < 0.95 ? 1 : 0;
    if (best->readings >= 3 && found[0].point.outcome == PointOutcome::kSolved) {
      EXPECT_EQ(found[0].point.readings, best->readings);
      EXPECT_LT((found[0].point.p - best->p).norm(), 1e-5);
    }
  }
  EXPECT_GT(doubtful, 1);  // or nothing was tried
}

}  // namespace
}  // namespace unfurl::measure::associate_test
