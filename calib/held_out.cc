#include "calib/held_out.h"

#include <algorithm>
#include <limits>

#include "base/dense.h"
#include "base/worker_pool.h"
#include "calib/common_error.h"
#include "calib/covariance.h"
#include "measure/camera_model.h"
#include "measure/triangulate.h"

namespace unfurl::calib {
namespace {

// The residual test is the fit's affair here; geometry that cannot give a point still does not.
const measure::TriangulateOptions kTriangulation{.residual_level = 1e-12};

// Derivative of a found point, less its survey without the common errors, by the cameras and the
// common errors; 3 x `size`. The calibration inherits the survey's common errors, so the two are
// correlated and much of them cancels here.
Eigen::MatrixXd ByCalibration(const Observations& data, const Weighting& weighting,
                              const std::vector<data::RigCamera>& cameras,
                              const measure::PointSolution& found, std::size_t first, int point,
                              Eigen::Index size) {
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(3, size);
  for (std::size_t k = first; k < data.readings.size() && data.readings[k].point == point; ++k) {
    const Reading& r = data.readings[k];
    measure::Projection h;
    if (!weighting.Uses(k) ||
        !measure::Project(cameras[static_cast<std::size_t>(r.camera)], found.p, &h)) {
      continue;
    }
    K.middleCols(data::kCameraParameters * r.camera, data::kCameraParameters) =
        -found.cov * h.du_dp.transpose() * h.du_dc / weighting.Variance(r);
  }
  const auto common = static_cast<Eigen::Index>(data.common.size());
  for (Eigen::Index m = 0; m < common; ++m) {
    K.col(size - common + m) = data.common[static_cast<std::size_t>(m)].shift.col(point);
  }
  return K;
}

HeldOutResult CheckFold(const Observations& data, const std::vector<CameraPrior>& priors,
                        const RefinedBundle& full, int folds, int fold) {
  std::vector<int> keep;
  for (int i = 0; i < data.points(); ++i) {
    if (i % folds != fold) keep.push_back(i);
  }
  const Observations kept = SelectPoints(data, keep);
  BundleState state{full.state.cameras, full.state.points(Eigen::all, keep), full.state.common};
  const Weighting& weighting = full.weighting;
  BundleOptions options;
  options.loss_width = std::numeric_limits<double>::infinity();
  options.function_tolerance = 1e-7;  // less than a hundredth of one sigma in all
  const BundleSummary summary =
      SolveBundle(kept, priors, SelectPoints(weighting, data, keep), options, &state);
  data::Rig rig;
  rig.cameras = state.cameras;
  Eigen::MatrixXd covariance = CameraCovariance(summary.information);
  ClearFixed(priors, &covariance);
  for (std::size_t j = 0; j < rig.cameras.size(); ++j) {
    rig.cameras[j].floor_px = weighting.floor_px[j];
  }
  // Few points leave cameras less well known than they read: their readings may contradict by that.
  const auto own = data::kCameraParameters * static_cast<Eigen::Index>(rig.cameras.size());
  rig.covariance = covariance.topLeftCorner(own, own);
  rig.volume_low = data.p.rowwise().minCoeff();
  rig.volume_high = data.p.rowwise().maxCoeff();
  const measure::Triangulator triangulator(rig, kTriangulation);

  HeldOutResult out;
  std::vector<double> u(rig.cameras.size()), s(rig.cameras.size());
  std::size_t k = 0;
  for (int i = 0; i < data.points(); ++i) {
    std::fill(u.begin(), u.end(), std::numeric_limits<double>::quiet_NaN());
    std::fill(s.begin(), s.end(), std::numeric_limits<double>::quiet_NaN());
    const std::size_t first = k;
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
    const Eigen::Vector3d surveyed = data.p.col(i) - CommonShift(data, state.common, i);
    const measure::PointSolution solution = triangulator.Solve(u, s, surveyed);
    if (solution.outcome != measure::PointOutcome::kSolved) {
      ++out.unsolved;
      continue;
    }
    const Eigen::MatrixXd K =
        ByCalibration(data, weighting, state.cameras, solution, first, i, covariance.rows());
    HeldOutPoint checked;
    checked.point = i;
    checked.readings = solution.readings;
    checked.error = solution.p - surveyed;
    checked.predicted = solution.cov + K * covariance * K.transpose() +
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
