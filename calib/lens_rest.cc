#include "calib/lens_rest.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "base/statistics.h"
#include "calib/parameters.h"
#include "calib/score_test.h"
#include "calib/survey_cost.h"
#include "measure/camera_model.h"
#include "measure/lens/lens.h"

namespace unfurl::calib {
namespace {

// Of an order of terms, the next one: as the lens models' priors have it (measure/lens) [-].
constexpr double kNextOrder = 1.0 / 3.0;
constexpr int kPlaces = 400;  // in the box: the mean of their squares is then known to a tenth [-]
constexpr int kWays = 2;      // in which an order goes on: with the field's square along, or across
constexpr double kRestRank = 1e-10;  // of a point's information: what its readings do not fix [-]

// Where a camera sees a point: slopes along its row and across.
Eigen::Vector2d SlopesOf(const data::RigCamera& camera, const Eigen::Vector3d& p) {
  const Eigen::Vector3d q = camera.R_CW * (p - camera.p_WC);
  return {q.x() / q.z(), q.y() / (q.z() + camera.e)};
}

// The highest order of a camera's lens as fitted, and how the next one would go on.
class Rest {
 public:
  explicit Rest(const data::RigCamera& camera)
      : camera_(&camera), last_(measure::LastOrderOf(camera.lens)) {}

  void Cover(const Eigen::Vector3d& p) {
    edge_ = edge_.cwiseMax(SlopesOf(*camera_, p).cwiseAbs2());
    most_px_ = std::max(most_px_, std::abs(HighestOrder(p)));
  }
  double most_px() const { return most_px_; }  // at the outermost reading
  // [px]
  Eigen::RowVector2d At(const Eigen::Vector3d& p) const {
    const Eigen::Vector2d share = SlopesOf(*camera_, p).cwiseAbs2().cwiseQuotient(edge_);
    return kNextOrder * HighestOrder(p) * share.transpose();
  }

 private:
  double HighestOrder(const Eigen::Vector3d& p) const {
    const Eigen::Vector2d at = SlopesOf(*camera_, p);
    const measure::LensImage image = measure::EvaluateLens(camera_->lens, at.x(), at.y(),
                                                           camera_->f_px, camera_->terms_px.data());
    double sum = 0.0;
    for (std::size_t k = 0; k < last_.size(); ++k) {
      if (last_[k]) sum += camera_->terms_px[k] * image.du_dt[k];
    }
    return sum;
  }

  const data::RigCamera* camera_;
  std::array<bool, data::kLensTerms> last_;
  Eigen::Vector2d edge_ = Eigen::Vector2d::Zero();  // squared slopes of the outermost readings
  double most_px_ = 0.0;
};

// Mean over places of the box of what each column does to squared errors of found points, over what
// the rig states of them [-]. `on_cameras`: how a unit of each column moved the fitted cameras.
Eigen::VectorXd RiseInBox(const data::Rig& rig, const std::vector<double>& weight,
                          const std::vector<Rest>& rests, const Eigen::MatrixXd& on_cameras) {
  const auto cameras = static_cast<Eigen::Index>(rig.cameras.size());
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(kWays * cameras);
  Eigen::MatrixXd by_cameras(3, kParameters * cameras), effect(3, kWays * cameras);
  double found = 0.0;
  for (int i = 0; i < kPlaces; ++i) {
    const Eigen::Vector3d share(SpreadPlace(i, 2), SpreadPlace(i, 3), SpreadPlace(i, 5));
    const Eigen::Vector3d p = rig.volume_low + share.cwiseProduct(rig.volume_high - rig.volume_low);
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    by_cameras.setZero();
    effect.setZero();
    int seen = 0;
    for (Eigen::Index j = 0; j < cameras; ++j) {
      const auto k = static_cast<std::size_t>(j);
      measure::Projection h;
      if (!measure::Project(rig.cameras[k], p, &h)) continue;
      if (h.u_px < 0.0 || h.u_px > rig.cameras[k].pixels - 1.0) continue;
      ++seen;
      const Eigen::Vector3d lever = weight[k] * h.du_dp.transpose();
      A += lever * h.du_dp;
      by_cameras.middleCols(kParameters * j, kParameters) = lever * h.du_dc;
      effect.middleCols(kWays * j, kWays) = lever * rests[k].At(p);
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(A);
    if (seen < 3 || !(eigen.eigenvalues()(0) > kRestRank * eigen.eigenvalues()(2))) continue;
    effect -= by_cameras * on_cameras.topRows(kParameters * cameras);
    // A C A of the point's covariance C, as the effect is A times what the point moves by.
    const Eigen::Matrix3d C = A + by_cameras * rig.covariance * by_cameras.transpose();
    sum += effect.cwiseProduct(C.llt().solve(effect)).colwise().sum().transpose() / 3.0;
    found += 1.0;
  }
  return sum / std::max(1.0, found);
}

std::string RestText(const Trend& trend, const std::string& camera, double all) {
  return fmt::format(
      "camera \"{}\": the highest terms of its lens make {:.2g} px at the ends of its readings. "
      "Were those that the model lacks a third of that, squared errors of points in the surveyed "
      "box would be {:.2g} times what is stated: no residual shows them, and error bars are too "
      "short where the lens is followed beyond the outermost points. Survey its row to the ends, "
      "and more densely there, or use less of it; a stop nearer to the glass bends less",
      camera, trend.rms, 1.0 + all);
}

}  // namespace

std::vector<Trend> FindLensRest(const Observations& data, const std::vector<CameraPrior>& priors,
                                const RefinedBundle& bundle, const data::Rig& rig,
                                const TrendOptions& options) {
  // A lens that was known before: another survey took most of it up.
  const auto known = [](const CameraPrior& prior) { return prior.lens_root.size() > 0; };
  if (std::any_of(priors.begin(), priors.end(), known)) return {};
  const ScoreTest test(data, priors, bundle);
  const std::size_t cameras = rig.cameras.size();
  std::vector<Rest> rests(rig.cameras.begin(), rig.cameras.end());
  std::vector<std::vector<double>> variance(cameras);
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const Reading& r = data.readings[k];
    if (!test.Uses(k)) continue;
    const auto j = static_cast<std::size_t>(r.camera);
    rests[j].Cover(bundle.state.points.col(r.point));
    variance[j].push_back(bundle.weighting.Variance(r));
  }
  Columns columns;
  columns.on_readings.setZero(static_cast<Eigen::Index>(data.readings.size()),
                              kWays * static_cast<Eigen::Index>(cameras));
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const Reading& r = data.readings[k];
    if (!test.Uses(k)) continue;
    columns.on_readings.block(static_cast<Eigen::Index>(k), kWays * r.camera, 1, kWays) =
        rests[static_cast<std::size_t>(r.camera)].At(bundle.state.points.col(r.point));
  }
  std::vector<double> weight;
  weight.reserve(cameras);
  for (const std::vector<double>& one : variance) {
    weight.push_back(one.empty() ? 0.0 : 1.0 / Median(one));
  }
  const Eigen::VectorXd rise = RiseInBox(rig, weight, rests, test.Of(columns).on_cameras);
  std::vector<Trend> out;
  double all = 0.0;
  for (std::size_t j = 0; j < cameras; ++j) {
    if (!(rests[j].most_px() > 0.0)) continue;
    Trend& trend = out.emplace_back();
    trend.kind = TrendKind::kLensRest;
    trend.camera = static_cast<int>(j);
    trend.rms = rests[j].most_px();
    trend.rise = rise.segment(kWays * static_cast<Eigen::Index>(j), kWays).sum();
    all += trend.rise;
  }
  if (!(all > options.harmless)) return out;
  Trend& worst = *std::max_element(out.begin(), out.end(),
                                   [](const Trend& a, const Trend& b) { return a.rise < b.rise; });
  worst.found = true;
  worst.text = RestText(worst, data.cameras[static_cast<std::size_t>(worst.camera)], all);
  return out;
}

}  // namespace unfurl::calib
