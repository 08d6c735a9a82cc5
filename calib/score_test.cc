#include "calib/score_test.h"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>

#include "calib/common_error.h"
#include "calib/covariance.h"
#include "calib/parameters.h"

namespace unfurl::calib {
namespace {

constexpr double kScoreRank = 1e-10;  // of a point's information: what its readings do not fix [-]

}  // namespace

ScoreTest::ScoreTest(const Observations& data, const std::vector<CameraPrior>& priors,
                     const RefinedBundle& bundle)
    : data_(data), bundle_(bundle) {
  // Terms that are held take no part.
  covariance_ = CameraCovariance(bundle.summary.information);
  const Eigen::Index cameras = kParameters * data.camera_count();
  Eigen::MatrixXd own = covariance_.topLeftCorner(cameras, cameras);
  ClearFixed(priors, &own);
  covariance_.topLeftCorner(cameras, cameras) = own;
  rows_.resize(data.readings.size());
  inverse_.resize(static_cast<std::size_t>(data.points()));
  std::size_t k = 0;
  for (int i = 0; i < data.points(); ++i) {
    Eigen::Matrix3d A = SurveyInformation(i);
    for (; k < data.readings.size() && data.readings[k].point == i; ++k) {
      Row& row = rows_[k];
      const Reading& r = data.readings[k];
      row.used = bundle.weighting.Uses(k) &&
                 measure::Project(bundle.state.cameras[static_cast<std::size_t>(r.camera)],
                                  bundle.state.points.col(i), &row.h);
      if (!row.used) continue;
      row.weight = 1.0 / bundle.weighting.Variance(r);
      A += row.weight * row.h.du_dp.transpose() * row.h.du_dp;
    }
    inverse_[static_cast<std::size_t>(i)] = A.inverse();
  }
}

Eigen::Matrix3d ScoreTest::SurveyInformation(int i) const {
  const auto point = static_cast<std::size_t>(i);
  return data_.cov[point].inverse() * bundle_.weighting.SurveyInformationScale(point);
}

ScoreTest::Score ScoreTest::Of(const Columns& columns) const {
  const Eigen::MatrixXd& on_readings = columns.on_readings;
  const Eigen::MatrixXd& on_survey = columns.on_survey;
  const Eigen::Index m = std::max(on_readings.cols(), on_survey.rows() / 3);
  Score out;
  out.value = Eigen::VectorXd::Zero(m);
  out.whole = Eigen::MatrixXd::Zero(m, m);
  Eigen::MatrixXd by_cameras = Eigen::MatrixXd::Zero(covariance_.rows(), m);
  Eigen::MatrixXd through_points = Eigen::MatrixXd::Zero(m, m);
  Eigen::MatrixXd by_point(3, m), mixed(covariance_.rows(), 3);
  std::size_t k = 0;
  for (int i = 0; i < data_.points(); ++i) {
    by_point.setZero();
    mixed.setZero();
    const Eigen::Matrix3d S = SurveyInformation(i);
    // A common error moves the surveyed place against the point.
    for (std::size_t q = 0; q < data_.common.size(); ++q) {
      mixed.row(covariance_.rows() - static_cast<Eigen::Index>(data_.common.size() - q)) =
          (S * data_.common[q].shift.col(i)).transpose();
    }
    if (on_survey.size() > 0) {
      const auto V = on_survey.col(i).reshaped(3, m);
      const Eigen::Vector3d d = data_.p.col(i) - bundle_.state.points.col(i) -
                                CommonShift(data_, bundle_.state.common, i);
      out.value += V.transpose() * (S * d);
      out.whole += V.transpose() * S * V;
      by_point += S * V;
      for (std::size_t q = 0; q < data_.common.size(); ++q) {
        by_cameras.row(covariance_.rows() - static_cast<Eigen::Index>(data_.common.size() - q)) +=
            data_.common[q].shift.col(i).transpose() * S * V;
      }
    }
    for (; k < data_.readings.size() && data_.readings[k].point == i; ++k) {
      const Row& row = rows_[k];
      if (!row.used) continue;
      const Eigen::Index first = kParameters * data_.readings[k].camera;
      mixed.middleRows(first, kParameters) += row.weight * row.h.du_dc.transpose() * row.h.du_dp;
      if (on_readings.size() == 0) continue;
      const auto v = on_readings.row(static_cast<Eigen::Index>(k));
      if (v.isZero(0.0)) continue;
      out.value += row.weight * bundle_.summary.residual_px[k] * v.transpose();
      out.whole += row.weight * v.transpose() * v;
      by_point += row.weight * row.h.du_dp.transpose() * v;
      by_cameras.middleRows(first, kParameters) += row.weight * row.h.du_dc.transpose() * v;
    }
    const Eigen::MatrixXd moved = inverse_[static_cast<std::size_t>(i)] * by_point;
    through_points += by_point.transpose() * moved;
    by_cameras -= mixed * moved;
  }
  out.on_cameras = covariance_ * by_cameras;
  out.covariance = out.whole - through_points - by_cameras.transpose() * out.on_cameras;
  return out;
}

double ScoreTest::RiseOfError(const Eigen::MatrixXd& at_use, const Eigen::MatrixXd& on_cameras,
                              const Eigen::MatrixXd& moment) const {
  const Eigen::MatrixXd harm = HarmOf(at_use, on_cameras);
  if (harm.size() == 0) return std::numeric_limits<double>::infinity();
  return harm.cwiseProduct(moment).sum();
}

Eigen::MatrixXd ScoreTest::HarmOf(const Eigen::MatrixXd& at_use,
                                  const Eigen::MatrixXd& on_cameras) const {
  const Eigen::Index m = on_cameras.cols();
  const Eigen::Index cameras = kParameters * data_.camera_count();
  const Eigen::MatrixXd of_rig = covariance_.topLeftCorner(cameras, cameras);
  Eigen::MatrixXd by_cameras(3, cameras), effect(3, m);
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(m, m);
  double found = 0.0;
  std::size_t k = 0;
  for (int i = 0; i < data_.points(); ++i) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    by_cameras.setZero();
    effect.setZero();
    for (; k < data_.readings.size() && data_.readings[k].point == i; ++k) {
      const Row& row = rows_[k];
      if (!row.used) continue;
      const Eigen::Vector3d lever = row.weight * row.h.du_dp.transpose();
      A += lever * row.h.du_dp;
      by_cameras.middleCols(kParameters * data_.readings[k].camera, kParameters) +=
          lever * row.h.du_dc;
      if (at_use.size() > 0) effect += lever * at_use.row(static_cast<Eigen::Index>(k));
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(A);
    if (!(eigen.eigenvalues()(0) > kScoreRank * eigen.eigenvalues()(2))) continue;
    // The point's own covariance is A^-1, and errors of readings move it by A^-1 H^T W.
    effect -= by_cameras * on_cameras.topRows(cameras);
    const Eigen::Matrix3d C = A + by_cameras * of_rig * by_cameras.transpose();  // A C' A
    sum += effect.transpose() * C.llt().solve(effect) / 3.0;
    found += 1.0;
  }
  if (!(found > 0.0)) return {};
  return sum / found;
}

}  // namespace unfurl::calib
