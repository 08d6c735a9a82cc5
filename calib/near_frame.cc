#include "calib/near_frame.h"

#include <cmath>

#include "base/statistics.h"
#include "calib/far_points.h"

namespace unfurl::calib {
namespace {

Observations About(const Eigen::Vector3d& origin, Observations data) {
  data.p.colwise() -= origin;
  for (SetUp& set_up : data.set_ups) set_up.middle -= origin;
  return data;
}

CalibrateOptions About(const Eigen::Vector3d& origin, CalibrateOptions options) {
  for (KnownLens& lens : options.guess.known) lens.camera.p_WC -= origin;
  options.explain.station -= origin;  // NaN where it is not known
  options.explain.origin += origin;
  return options;
}

void MoveBack(const Eigen::Vector3d& origin, data::Rig* rig) {
  for (data::RigCamera& camera : rig->cameras) camera.p_WC += origin;
  rig->volume_low += origin;
  rig->volume_high += origin;
}

void MoveBack(const Eigen::Vector3d& origin, CameraPrior* prior) {
  prior->along += prior->axis.dot(origin);
}

void MoveBack(const Eigen::Vector3d& origin, BundleState* state) {
  for (data::RigCamera& camera : state->cameras) camera.p_WC += origin;
  if (state->points.cols() > 0) state->points.colwise() += origin;
}

// Without points that lie far outside of the others, unless that is where their readings are.
Calibration CalibrateMost(const Observations& data, const CalibrateOptions& options,
                          const std::string& where) {
  std::vector<int> far = FarPoints(data.p);
  if (far.empty()) return CalibrateHere(data, options, where);
  Calibration out = CalibrateHere(Unseen(data, far), options, where);
  std::vector<FarPoint> wrong = FindFarPoints(data, far, out.rig);
  std::erase_if(wrong, [](const FarPoint& one) { return one.right; });
  if (wrong.size() < far.size()) {
    far.clear();
    for (const FarPoint& one : wrong) far.push_back(one.point);
    out = CalibrateHere(far.empty() ? data : Unseen(data, far), options, where);
  }
  for (const FarPoint& one : wrong) {
    out.report.survey_weight[static_cast<std::size_t>(one.point)] = Weighting::kLeftOut;
    out.report.gross.insert(out.report.gross.begin(), Finding(data, one));
    out.rig.reasons.push_back(out.report.gross.front().text + "; it was left out");
  }
  out.report.far = std::move(wrong);
  return out;
}

}  // namespace

Eigen::Vector3d MiddleOf(const Eigen::Matrix3Xd& p) {
  Eigen::Vector3d middle;
  for (Eigen::Index k = 0; k < 3; ++k) {
    middle(k) = Median(std::vector<double>(p.row(k).begin(), p.row(k).end()));
  }
  return middle;
}

double UsualDistance(const Eigen::Matrix3Xd& p, const Eigen::Vector3d& middle) {
  const Eigen::RowVectorXd away = (p.colwise() - middle).colwise().norm();
  return Median(std::vector<double>(away.begin(), away.end()));
}

Eigen::Vector3d NearOrigin(const Eigen::Matrix3Xd& p) {
  if (p.cols() == 0 || !p.allFinite()) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d middle = MiddleOf(p);
  const double spread = UsualDistance(p, middle);
  if (!(spread > 0.0) || middle.norm() <= kFarFromOrigin * spread) return Eigen::Vector3d::Zero();
  const double grain = std::exp2(std::floor(std::log2(spread)));
  return ((middle / grain).array().round() * grain).matrix();
}

RigFit FitRig(const Observations& data, const CalibrateOptions& options, const std::string& where) {
  const Eigen::Vector3d origin = NearOrigin(data.p);
  if (origin.isZero(0.0)) return FitHere(data, options, where);
  RigFit fit = FitHere(About(origin, data), About(origin, options), where);
  for (CameraGuess& guess : fit.guesses) {
    guess.camera.p_WC += origin;
    MoveBack(origin, &guess.prior);
    MoveBack(origin, &guess.richest);
  }
  for (CameraPrior& prior : fit.priors) MoveBack(origin, &prior);
  MoveBack(origin, &fit.bundle.state);
  MoveBack(origin, &fit.rig);
  return fit;
}

Calibration Calibrate(const Observations& data, const CalibrateOptions& options,
                      const std::string& where) {
  const Eigen::Vector3d origin = NearOrigin(data.p);
  if (origin.isZero(0.0)) return CalibrateMost(data, options, where);
  Calibration out = CalibrateMost(About(origin, data), About(origin, options), where);
  MoveBack(origin, &out.rig);
  for (SetUpEstimate& set_up : out.report.set_ups) set_up.middle += origin;
  for (FarPoint& far : out.report.far) far.at += origin;
  for (OrderTrial& trial : out.report.orders) {
    for (CameraPrior& prior : trial.priors) MoveBack(origin, &prior);
    MoveBack(origin, &trial.bundle.state);
  }
  return out;
}

}  // namespace unfurl::calib
