#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "base/statistics.h"
#include "base/worker_pool.h"
#include "calib/wand_poses.h"
#include "calib/wand_shape.h"
#include "measure/triangulate.h"

namespace unfurl::calib {
namespace {

constexpr int kWaves = 8;  // half waves, from one over the whole to eight

// A mark of one pose, from its readings alone.
struct FoundMark {
  WandGridPoint at;
  double after = 0.0;  // mean time of its flashes [s]
};
bool FindMark(const WandFit& all, const WandFit& rest, const measure::Triangulator& triangulator,
              int pose, int mark, FoundMark* out) {
  const std::size_t c = rest.state.cameras.size();
  std::vector<double> u(c, std::numeric_limits<double>::quiet_NaN()), s = u;
  std::vector<char> use(c, 0);
  double n = 0.0;
  for (std::size_t k = 0; k < all.data.readings.size(); ++k) {
    const WandReading& r = all.data.readings[k];
    if (r.pose != pose || r.mark != mark || all.weighting.use_reading[k] == 0) continue;
    const auto j = static_cast<std::size_t>(r.camera);
    u[j] = r.u_px;
    s[j] = r.s_px;
    use[j] = 1;
    out->after += r.after;
    n += 1.0;
  }
  if (n < 3.0) return false;
  out->after /= n;
  const measure::PointSolution found =
      triangulator.Solve(u, s, all.state.Mark(pose, mark, out->after));
  if (found.outcome != measure::PointOutcome::kSolved) return false;
  if (!PlaceOf(rest, found.p, use, &out->at)) return false;
  out->at.cov = found.cov;
  return true;
}

void CheckFold(const WandFit& fit, const BundleOptions& options, int folds, int fold,
               WandLengths* out) {
  std::vector<int> keep;
  for (int k = 0; k < fit.data.pose_count(); ++k) {
    if (k % folds != fold) keep.push_back(k);
  }
  WandFit rest = KeepPoses(fit, keep);
  BundleOptions near = options;
  near.function_tolerance = 1e-7;  // less than a hundredth of one sigma in all
  RefitWand(near, &rest);
  data::Rig rig;
  rig.cameras = rest.state.cameras;
  for (std::size_t j = 0; j < rig.cameras.size(); ++j) {
    rig.cameras[j].floor_px = fit.weighting.floor_px[j];
  }
  rig.volume_low = fit.state.middle.rowwise().minCoeff().array() - 0.5 * fit.data.Length();
  rig.volume_high = fit.state.middle.rowwise().maxCoeff().array() + 0.5 * fit.data.Length();
  // The residual test is the fit's affair here; geometry that cannot give a point still does not.
  const measure::Triangulator triangulator(rig, {.residual_level = 1e-12});
  const int last = fit.data.mark_count() - 1;
  const auto cameras =
      static_cast<Eigen::Index>(rest.state.cameras.size()) * data::kCameraParameters;
  for (int k = fold; k < fit.data.pose_count(); k += folds) {
    FoundMark a, b;
    if (!FindMark(fit, rest, triangulator, k, 0, &a) ||
        !FindMark(fit, rest, triangulator, k, last, &b)) {
      ++out->unsolved;
      continue;
    }
    // The bar moved on between the flashes; how fast, all poses together say.
    const double later = b.after - a.after;
    const Eigen::Vector3d bar = b.at.p - a.at.p - later * fit.state.velocity.col(k);
    const Eigen::Vector3d d = bar.normalized();
    const double place = rest.state.place(last) - rest.state.place(0);
    // By the cameras and the place of the last mark, which the rest of the poses estimate.
    Eigen::RowVectorXd by = Eigen::RowVectorXd::Zero(rest.system.covariance.rows());
    by.head(cameras) = d.transpose() * (b.at.by_cameras - a.at.by_cameras);
    by(cameras + last - 1) = -1.0;
    WandLength length;
    length.pose = fit.data.poses[static_cast<std::size_t>(k)];
    length.error = bar.norm() - place;
    length.predicted = std::sqrt(
        (by * rest.system.covariance * by.transpose()).value() + d.dot((a.at.cov + b.at.cov) * d) +
        later * later * fit.system.speed_variance[static_cast<std::size_t>(k)]);
    if (!(length.predicted > 0.0)) {  // round-off of what is not determined at all
      ++out->unsolved;
      continue;
    }
    out->found.push_back(length);
  }
}

// The statistic of eight half waves of `phase` (0 to 1) in whitened residuals, each made orthogonal
// to those before: chi-square of 8 degrees of freedom at most.
double WaveSquares(const std::vector<double>& phase, const std::vector<double>& whitened) {
  const auto n = static_cast<Eigen::Index>(phase.size());
  Eigen::MatrixXd V(n, kWaves);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (int k = 0; k < kWaves; ++k) {
      V(i, k) = std::cos(M_PI * (k + 1.0) * phase[static_cast<std::size_t>(i)]);
    }
  }
  const Eigen::VectorXd r = Eigen::VectorXd::Map(whitened.data(), n);
  const Eigen::MatrixXd Q = Eigen::HouseholderQR<Eigen::MatrixXd>(V).householderQ() *
                            Eigen::MatrixXd::Identity(n, kWaves);
  return (Q.transpose() * r).squaredNorm();
}

}  // namespace

WandLengths HeldOutLengths(const WandFit& fit, const BundleOptions& options, int folds,
                           std::size_t workers) {
  std::vector<WandLengths> by_fold(static_cast<std::size_t>(folds));
  ParallelFor(by_fold.size(), workers, [&](std::size_t fold) {
    CheckFold(fit, options, folds, static_cast<int>(fold), &by_fold[fold]);
  });
  WandLengths out;
  for (const WandLengths& fold : by_fold) {
    out.found.insert(out.found.end(), fold.found.begin(), fold.found.end());
    out.unsolved += fold.unsolved;
  }
  return out;
}

std::vector<std::string> WandTrends(const WandFit& fit, double level) {
  std::vector<std::string> out;
  const double tests = 2.0 * static_cast<double>(fit.data.cameras.size());
  for (std::size_t j = 0; j < fit.data.cameras.size(); ++j) {
    std::vector<double> order, field, whitened;
    for (std::size_t k = 0; k < fit.data.readings.size(); ++k) {
      const WandReading& r = fit.data.readings[k];
      if (r.camera != static_cast<int>(j) || fit.weighting.use_reading[k] == 0) continue;
      order.push_back((r.pose + 0.5) / fit.data.pose_count());
      field.push_back(std::clamp(r.u_px / fit.state.cameras[j].pixels, 0.0, 1.0));
      whitened.push_back(fit.summary.residual_px[k] /
                         std::sqrt(fit.weighting.Variance(r.camera, r.s_px)));
    }
    if (whitened.size() < 4 * kWaves) continue;
    const auto test = [&](const std::vector<double>& phase, const char* what) {
      const double chance = ChiSquareTail(WaveSquares(phase, whitened), kWaves);
      if (chance * tests > level) return;
      out.push_back(fmt::format("the residuals of camera \"{}\" follow {} (p = {:.1g})",
                                fit.data.cameras[j], what, chance));
    };
    test(order,
         "the order of the poses: it, or its sensor, moved or warmed while the bar was waved");
    test(field, "the place on its row: its lens is not of the model's kind");
  }
  return out;
}

}  // namespace unfurl::calib
