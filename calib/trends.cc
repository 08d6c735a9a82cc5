#include "calib/trends.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/length.h"
#include "base/refuse_option.h"
#include "base/statistics.h"
#include "calib/common_error.h"
#include "calib/covariance.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

constexpr Eigen::Index kParameters = data::kCameraParameters;
constexpr int kTimeWaves = 8;    // half waves over the survey: a step in its middle is seen too
constexpr int kFieldWaves = 24;  // half waves over the row: shorter ones are noise to the points
constexpr int kCrossWaves = 6;   // of those that go across the row as well, both together
constexpr int kVolumeWaves = 4;  // of a survey's shape along all axes together
// A pattern's mean square over the readings' variance: below, squared errors of found points grow
// by as much at most, which is no reason to mistrust them [-].
constexpr double kHarmless = 0.2;
// Share of a function's information that must be left after the fit of cameras and points; less,
// and what is tested is round-off and priors [-].
constexpr double kLeastLeft = 1e-3;

// The normal equations of the bundle, with points eliminated, for testing added columns.
class ScoreTest {
 public:
  ScoreTest(const Observations& data, const std::vector<CameraPrior>& priors,
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

  bool Uses(std::size_t reading) const { return rows_[reading].used; }

  // Of m columns on the readings (n x m), and on the surveyed places (3 m x n; empty: none).
  struct Score {
    Eigen::VectorXd value;       // m
    Eigen::MatrixXd covariance;  // of it after the fit, m x m
    Eigen::MatrixXd whole;       // the same were cameras and points known
    Eigen::MatrixXd on_cameras;  // by how much a unit of each column moves the fitted cameras
  };
  Score Of(const Eigen::MatrixXd& on_readings, const Eigen::MatrixXd& on_survey) const {
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
      if (on_survey.size() > 0) {
        const auto V = on_survey.col(i).reshaped(3, m);
        const Eigen::Vector3d d =
            data_.p.col(i) - bundle_.state.points.col(i) -
            (data_.common.empty() ? Eigen::Vector3d::Zero().eval()
                                  : CommonShift(data_, bundle_.state.common, i));
        out.value += V.transpose() * (S * d);
        out.whole += V.transpose() * S * V;
        by_point += S * V;
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

 private:
  struct Row {
    bool used = false;
    double weight = 0.0;
    measure::Projection h;
  };
  Eigen::Matrix3d SurveyInformation(int i) const {
    const auto point = static_cast<std::size_t>(i);
    return data_.cov[point].inverse() * bundle_.weighting.SurveyInformationScale(point);
  }

  const Observations& data_;
  const RefinedBundle& bundle_;
  Eigen::MatrixXd covariance_;  // of cameras and common errors
  std::vector<Row> rows_;
  std::vector<Eigen::Matrix3d> inverse_;  // of each point's information
};

// A family of functions, each of unit mean square, with the variances that they are weighed by.
struct Family {
  Trend trend;
  Eigen::MatrixXd on_readings, on_survey;
  std::vector<double> prior;
};

double HalfWave(int k, double x01) { return std::cos(k * std::numbers::pi * x01); }

// Functions of the order of measuring, from 0 to 1: the straight line, then half waves.
Eigen::MatrixXd TimeWaves(int points) {
  Eigen::MatrixXd out(points, 1 + kTimeWaves);
  for (int i = 0; i < points; ++i) {
    const double t = (i + 0.5) / points;
    out(i, 0) = std::numbers::sqrt3 * (2.0 * t - 1.0);
    for (int k = 1; k <= kTimeWaves; ++k) out(i, k) = std::numbers::sqrt2 * HalfWave(k, t);
  }
  return out;
}

// Half waves are weighed as a random walk's are.
double TimeVariance(Eigen::Index k) { return k == 0 ? 1.0 : 1.0 / static_cast<double>(k * k); }

Family DriftOfReadings(const Observations& data, const ScoreTest& test, int camera,
                       const Eigen::MatrixXd& waves) {
  Family out;
  out.trend = {TrendKind::kReadingDrift, camera};
  out.on_readings.setZero(static_cast<Eigen::Index>(data.readings.size()), waves.cols());
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const Reading& r = data.readings[k];
    if (r.camera == camera && test.Uses(k)) {
      out.on_readings.row(static_cast<Eigen::Index>(k)) = waves.row(r.point);
    }
  }
  for (Eigen::Index k = 0; k < waves.cols(); ++k) out.prior.push_back(TimeVariance(k));
  return out;
}

Family DriftOfSurvey(const Observations& data, const Eigen::MatrixXd& waves) {
  Family out;
  out.trend = {TrendKind::kSurveyDrift, -1};
  out.on_survey.setZero(9 * waves.cols(), data.points());
  for (int i = 0; i < data.points(); ++i) {
    for (Eigen::Index k = 0; k < waves.cols(); ++k) {
      for (Eigen::Index a = 0; a < 3; ++a) {
        out.on_survey(3 * (3 * k + a) + a, i) = waves(i, k);
      }
    }
  }
  for (Eigen::Index k = 0; k < waves.cols(); ++k) {
    out.prior.insert(out.prior.end(), 3, TimeVariance(k));
  }
  return out;
}

// Where a point appears to a camera: along the row, and across it.
Eigen::Vector2d FieldOf(const data::RigCamera& camera, const Eigen::Vector3d& p) {
  const Eigen::Vector3d q = camera.R_CW * (p - camera.p_WC);
  return {q.x() / q.z(), q.y() / (q.z() + camera.e)};
}

Family PatternOf(const Observations& data, const RefinedBundle& bundle, const ScoreTest& test,
                 int camera) {
  Family out;
  out.trend = {TrendKind::kPattern, camera};
  std::vector<std::size_t> mine;
  std::vector<Eigen::Vector2d> at;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(HUGE_VAL), high = -low;
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const Reading& r = data.readings[k];
    if (r.camera != camera || !test.Uses(k)) continue;
    mine.push_back(k);
    at.push_back(FieldOf(bundle.state.cameras[static_cast<std::size_t>(camera)],
                         bundle.state.points.col(r.point)));
    low = low.cwiseMin(at.back());
    high = high.cwiseMax(at.back());
  }
  std::vector<std::pair<int, int>> waves;
  for (int k = 1; k <= kFieldWaves; ++k) waves.emplace_back(k, 0);
  for (int k = 0; k <= kCrossWaves; ++k) {
    for (int l = 1; k + l <= kCrossWaves; ++l) waves.emplace_back(k, l);
  }
  out.on_readings.setZero(static_cast<Eigen::Index>(data.readings.size()),
                          static_cast<Eigen::Index>(waves.size()));
  for (std::size_t m = 0; m < mine.size(); ++m) {
    const Eigen::Vector2d x = (at[m] - low).cwiseQuotient(high - low);
    for (std::size_t w = 0; w < waves.size(); ++w) {
      const auto [k, l] = waves[w];
      out.on_readings(static_cast<Eigen::Index>(mine[m]), static_cast<Eigen::Index>(w)) =
          (k > 0 ? std::numbers::sqrt2 : 1.0) * HalfWave(k, x(0)) *
          (l > 0 ? std::numbers::sqrt2 : 1.0) * HalfWave(l, x(1));
    }
  }
  for (const auto& [k, l] : waves) out.prior.push_back(1.0 / (k + l));
  return out;
}

Family ShapeOfSurvey(const Observations& data) {
  Family out;
  out.trend = {TrendKind::kSurveyShape, -1};
  const Eigen::Vector3d low = data.p.rowwise().minCoeff(), high = data.p.rowwise().maxCoeff();
  std::vector<Eigen::Vector3i> waves;
  for (int a = 0; a <= kVolumeWaves; ++a) {
    for (int b = 0; a + b <= kVolumeWaves; ++b) {
      for (int c = 0; a + b + c <= kVolumeWaves; ++c) {
        if (a + b + c > 0) waves.emplace_back(a, b, c);
      }
    }
  }
  const auto m = static_cast<Eigen::Index>(3 * waves.size());
  out.on_survey.setZero(3 * m, data.points());
  for (int i = 0; i < data.points(); ++i) {
    const Eigen::Vector3d x = (data.p.col(i) - low).cwiseQuotient(high - low);
    for (std::size_t w = 0; w < waves.size(); ++w) {
      double value = 1.0;
      for (int a = 0; a < 3; ++a) {
        value *= (waves[w](a) > 0 ? std::numbers::sqrt2 : 1.0) * HalfWave(waves[w](a), x(a));
      }
      for (Eigen::Index a = 0; a < 3; ++a) {
        out.on_survey(3 * (3 * static_cast<Eigen::Index>(w) + a) + a, i) = value;
      }
    }
  }
  for (const Eigen::Vector3i& w : waves) out.prior.insert(out.prior.end(), 3, 1.0 / w.sum());
  return out;
}

// What coefficients are estimated as, and the covariance of that.
struct Coefficients {
  Eigen::VectorXd value;
  Eigen::MatrixXd covariance;
};

// Whether the coefficients' score is larger than chance makes it, and what they are estimated as.
Coefficients Judge(const ScoreTest& test, Family* family) {
  ScoreTest::Score score = test.Of(family->on_readings, family->on_survey);
  const auto m = static_cast<Eigen::Index>(family->prior.size());
  Eigen::VectorXd d = Eigen::VectorXd::Map(family->prior.data(), m);
  for (Eigen::Index k = 0; k < m; ++k) {
    if (score.covariance(k, k) < kLeastLeft * score.whole(k, k)) d(k) = 0.0;
  }
  // T = s' D s has the mean tr(D M) and the variance 2 tr(D M D M); matched by a multiple of a
  // chi-square variable [Satterthwaite].
  const Eigen::MatrixXd DM = d.asDiagonal() * score.covariance;
  const double mean = DM.trace(), square = (DM * DM).trace();
  const Coefficients none = {Eigen::VectorXd::Zero(m), Eigen::MatrixXd::Zero(m, m)};
  if (!(mean > 0.0) || !(square > 0.0)) return none;
  const double value = score.value.dot(d.asDiagonal() * score.value);
  family->trend.chance = ChiSquareTail(value * mean / square, mean * mean / square);
  // Best linear prediction with the variance that gives T its value.
  const double variance = (value - mean) / square;
  if (!(variance > 0.0)) return none;
  const Eigen::VectorXd prior = variance * d;
  const Eigen::MatrixXd C = score.covariance * prior.asDiagonal();
  const Eigen::MatrixXd posterior =
      prior.asDiagonal() *
      (Eigen::MatrixXd::Identity(m, m) + C).partialPivLu().solve(Eigen::MatrixXd::Identity(m, m));
  const Eigen::VectorXd z = posterior * score.value;
  family->trend.rms = z.norm();
  family->trend.sigma = std::sqrt(std::max(0.0, posterior.trace()));
  return {z, posterior};
}

std::string TextOf(const Trend& trend, const std::vector<std::string>& cameras) {
  const std::string camera =
      trend.camera < 0 ? "" : cameras[static_cast<std::size_t>(trend.camera)];
  switch (trend.kind) {
    case TrendKind::kReadingDrift:
      return fmt::format(
          "camera \"{}\": its readings drift over the survey, by {:+.2f} px from the first point "
          "to the last ({:.2f} px RMS): it moved, or warmed up. Let it warm up and survey again, "
          "or measure some of the first points again at the end",
          camera, trend.change, trend.rms);
    case TrendKind::kSurveyDrift:
      return fmt::format(
          "the surveyed places drift over the survey, by {} RMS: the station or what carries the "
          "points moved. Measure some of the first points again",
          LengthText(trend.rms));
    case TrendKind::kPattern:
      return fmt::format(
          "camera \"{}\": its readings follow a pattern over the field that its lens model does "
          "not make, {:.2f} px RMS: error bars are too short where it is. Look for a window, a "
          "reflection or a wrong flat field, or give the lens model (--lens)",
          camera, trend.rms);
    case TrendKind::kSurveyShape:
      break;
  }
  return fmt::format(
      "the surveyed places are distorted over the volume, by {} RMS beyond their sigmas: check the "
      "station's level, its prism and what was measured in which set-up",
      LengthText(trend.rms));
}

// Whether a pattern is so small beside the readings' errors that no error bar shows it.
bool IsHarmless(const Observations& data, const RefinedBundle& bundle, const Trend& trend) {
  if (trend.kind != TrendKind::kPattern) return false;
  std::vector<double> variance;
  for (const Reading& r : data.readings) {
    if (r.camera == trend.camera) variance.push_back(bundle.weighting.Variance(r));
  }
  return variance.empty() || trend.rms * trend.rms < kHarmless * Median(variance);
}

// One camera's drift, counted from the end of the survey: that is where the rig is used from.
void AddDrift(const ScoreTest& test, const Eigen::MatrixXd& waves, const Coefficients& found,
              Family* family, TrendResult* out) {
  Eigen::MatrixXd& V = family->on_readings;
  for (Eigen::Index k = 0; k < V.rows(); ++k) {
    if (!V.row(k).isZero(0.0)) V.row(k) -= waves.bottomRows(1).row(0);
  }
  const Eigen::VectorXd drift = V * found.value;
  out->drift_px.assign(drift.data(), drift.data() + drift.size());
  const Eigen::MatrixXd by = test.Of(V, family->on_survey).on_cameras;
  out->covariance = by * found.covariance * by.transpose();
}

}  // namespace

const char* Name(TrendKind kind) {
  switch (kind) {
    case TrendKind::kReadingDrift:
      return "drift of readings";
    case TrendKind::kSurveyDrift:
      return "drift of the survey";
    case TrendKind::kPattern:
      return "pattern over the field";
    case TrendKind::kSurveyShape:
      break;
  }
  return "shape of the survey";
}

void TrendOptions::Check() const {
  const RefuseOption refuse("TrendOptions");
  if (!(level > 0.0 && level < 1.0))
    refuse("level", "is not between 0 and 1", "give a probability");
}

TrendResult TestTrends(const Observations& data, const std::vector<CameraPrior>& priors,
                       const RefinedBundle& bundle, const TrendOptions& options) {
  const ScoreTest test(data, priors, bundle);
  const Eigen::MatrixXd waves = TimeWaves(data.points());
  TrendResult out;
  std::vector<Family> drifts;
  std::vector<Coefficients> coefficients;
  for (int j = 0; j < data.camera_count(); ++j) {
    drifts.push_back(DriftOfReadings(data, test, j, waves));
    coefficients.push_back(Judge(test, &drifts.back()));
    Trend& drift = drifts.back().trend;
    drift.change = (waves.bottomRows(1) - waves.topRows(1)).row(0).dot(coefficients.back().value);
    out.trends.push_back(drift);
    Family pattern = PatternOf(data, bundle, test, j);
    Judge(test, &pattern);
    out.trends.push_back(pattern.trend);
  }
  Family survey_drift = DriftOfSurvey(data, waves), shape = ShapeOfSurvey(data);
  Judge(test, &survey_drift);
  Judge(test, &shape);
  out.trends.push_back(survey_drift.trend);
  out.trends.push_back(shape.trend);
  // Sidak's price for having looked so often. One camera's drift shows in the others' residuals at
  // the same points: only the least probable is named.
  const double each =
      1.0 - std::pow(1.0 - options.level, 1.0 / static_cast<double>(out.trends.size()));
  Trend* least = nullptr;
  for (Trend& trend : out.trends) {
    if (IsHarmless(data, bundle, trend)) continue;
    if (least == nullptr || trend.chance < least->chance) least = &trend;
  }
  if (least == nullptr) return out;
  if (!(least->chance < each)) return out;
  least->found = true;
  least->text = TextOf(*least, data.cameras);
  if (least->kind == TrendKind::kReadingDrift) {
    const auto j = static_cast<std::size_t>(least->camera);
    AddDrift(test, waves, coefficients[j], &drifts[j], &out);
  }
  return out;
}

Observations WithoutDrift(Observations data, const TrendResult& trends) {
  for (std::size_t k = 0; k < trends.drift_px.size(); ++k) {
    data.readings[k].u_px -= trends.drift_px[k];
  }
  return data;
}

}  // namespace unfurl::calib
