#include "calib/held_out.h"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>

#include "base/worker_pool.h"
#include "calib/covariance.h"
#include "measure/triangulate.h"

namespace unfurl::calib {
namespace {

// The residual test is the fit's affair here; geometry that cannot give a point still does not.
const measure::TriangulateOptions kTriangulation{.residual_level = 1e-12};

HeldOutResult CheckFold(const Observations& data, const std::vector<CameraPrior>& priors,
                        const RefinedBundle& full, int folds, int fold) {
  std::vector<int> keep;
  for (int i = 0; i < data.points(); ++i) {
    if (i % folds != fold) keep.push_back(i);
  }
  const Observations kept = SelectPoints(data, keep);
  BundleState state{full.state.cameras, full.state.points(Eigen::all, keep)};
  const Weighting& weighting = full.weighting;
  BundleOptions options;
  options.loss_width = std::numeric_limits<double>::infinity();
  const BundleSummary summary =
      SolveBundle(kept, priors, SelectPoints(weighting, data, keep), options, &state);
  data::Rig rig;
  rig.cameras = state.cameras;
  rig.covariance = CameraCovariance(summary.information);
  ClearFixed(priors, &rig.covariance);
  for (std::size_t j = 0; j < rig.cameras.size(); ++j) {
    rig.cameras[j].floor_px = weighting.floor_px[j];
  }
  rig.volume_low = data.p.rowwise().minCoeff();
  rig.volume_high = data.p.rowwise().maxCoeff();
  const measure::Triangulator triangulator(rig, kTriangulation);

  HeldOutResult out;
  Eigen::Matrix3Xd F(3, triangulator.shared_rank());
  std::vector<double> u(rig.cameras.size()), s(rig.cameras.size());
  std::size_t k = 0;
  for (int i = 0; i < data.points(); ++i) {
    std::fill(u.begin(), u.end(), std::numeric_limits<double>::quiet_NaN());
    std::fill(s.begin(), s.end(), std::numeric_limits<double>::quiet_NaN());
    for (; k < data.readings.size() && data.readings[k].point == i; ++k) {
      const Reading& r = data.readings[k];
      if (!weighting.Uses(k)) continue;
      u[static_cast<std::size_t>(r.camera)] = r.u_px;
      s[static_cast<std::size_t>(r.camera)] = r.s_px;
    }
    const auto point = static_cast<std::size_t>(i);
    if (i % folds != fold || !weighting.UsesSurvey(point)) continue;
    // From where the survey has the point: three surfaces can meet twice in the corners of a
    // volume, and this check is not about telling which.
    const measure::PointSolution solution = triangulator.Solve(u, s, data.p.col(i));
    if (solution.outcome != measure::PointOutcome::kSolved) {
      ++out.unsolved;
      continue;
    }
    triangulator.SharedFactor(solution, s, F);
    HeldOutPoint checked;
    checked.point = i;
    checked.readings = solution.readings;
    checked.error = solution.p - data.p.col(i);
    checked.predicted = solution.cov + F * F.transpose() +
                        weighting.survey_factor * weighting.survey_factor * data.cov[point];
    checked.squared = checked.error.dot(checked.predicted.llt().solve(checked.error));
    out.points.push_back(checked);
  }
  return out;
}

}  // namespace

HeldOutResult CheckHeldOut(const Observations& data, const std::vector<CameraPrior>& priors,
                           const RefinedBundle& full, int folds, std::size_t workers) {
  folds = std::min(folds, data.points());
  std::vector<HeldOutResult> by_fold(static_cast<std::size_t>(folds));
  ParallelFor(by_fold.size(), workers, [&](std::size_t fold) {
    by_fold[fold] = CheckFold(data, priors, full, folds, static_cast<int>(fold));
  });
  HeldOutResult out;
  for (const HeldOutResult& fold : by_fold) {
    out.points.insert(out.points.end(), fold.points.begin(), fold.points.end());
    out.unsolved += fold.unsolved;
  }
  std::sort(out.points.begin(), out.points.end(),
            [](const HeldOutPoint& a, const HeldOutPoint& b) { return a.point < b.point; });
  return out;
}

}  // namespace unfurl::calib
