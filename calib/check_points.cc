#include "calib/check_points.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"

namespace unfurl::calib {

namespace {

constexpr double kNoReading = std::numeric_limits<double>::quiet_NaN();

}  // namespace

measure::Triangulator CheckTriangulator(const data::Rig& rig) {
  return measure::Triangulator(rig, {.residual_level = 1e-12});
}

std::vector<Found> FindPoints(const measure::Triangulator& triangulator, const Observations& data,
                              const std::vector<std::size_t>& match) {
  const data::Rig& rig = triangulator.rig();
  std::vector<Found> out(static_cast<std::size_t>(data.points()));
  std::vector<double> u(rig.cameras.size()), s(rig.cameras.size());
  std::size_t k = 0;
  for (int i = 0; i < data.points(); ++i) {
    std::fill(u.begin(), u.end(), kNoReading);
    std::fill(s.begin(), s.end(), kNoReading);
    for (; k < data.readings.size() && data.readings[k].point == i; ++k) {
      const std::size_t c = match[static_cast<std::size_t>(data.readings[k].camera)];
      u[c] = data.readings[k].u_px;
      s[c] = data.readings[k].s_px;
    }
    Found& found = out[static_cast<std::size_t>(i)];
    found.F.setZero(3, triangulator.shared_rank());
    found.solution = triangulator.Solve(u, s, data.p.col(i));
    if (found.solution.outcome != measure::PointOutcome::kSolved) {
      // A slip of the survey may lie where no camera looks.
      found.solution = triangulator.Solve(u, s, 0.5 * (rig.volume_low + rig.volume_high));
    }
    if (found.solution.outcome == measure::PointOutcome::kSolved) {
      triangulator.SharedFactor(found.solution, s, found.F);
    }
  }
  return out;
}

Observations Nearer(const data::Rig& rig, Observations data, const std::vector<Found>& found,
                    const std::vector<CheckedPoint>& checked) {
  // Of the volume's diagonal: no camera that was bumped moves a point so far.
  constexpr double kFar = 0.1, kNear = 0.01;
  // Of what is predicted: beyond doubt, and as near as that allows.
  constexpr double kNoDoubt = 30.0;
  const double diagonal = (rig.volume_high - rig.volume_low).norm();
  double predicted = 0.0;
  for (const CheckedPoint& point : checked) {
    if (std::isfinite(point.predicted)) predicted = std::max(predicted, point.predicted);
  }
  const double most = predicted > 0.0 ? kNoDoubt * predicted : kNear * diagonal;
  std::vector<int> far;
  for (int i = 0; i < data.points(); ++i) {
    const measure::PointSolution& at = found[static_cast<std::size_t>(i)].solution;
    const bool meet = at.outcome == measure::PointOutcome::kSolved ||
                      at.outcome == measure::PointOutcome::kDisagree;
    if (meet && !((data.p.col(i) - at.p).norm() <= kFar * diagonal)) far.push_back(i);
  }
  if (2 * static_cast<int>(far.size()) > data.points()) return data;
  for (const int i : far) {
    const Eigen::Vector3d at = found[static_cast<std::size_t>(i)].solution.p;
    Eigen::Vector3d off = data.p.col(i) - at;
    off /= off.cwiseAbs().maxCoeff();  // which can be squared
    data.p.col(i) = at + most * off.normalized();
  }
  return data;
}

}  // namespace unfurl::calib
