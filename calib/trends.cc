#include "calib/trends.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/length.h"
#include "base/refuse_option.h"
#include "base/statistics.h"
#include "calib/score_test.h"

namespace unfurl::calib {
namespace {

// Share of a function's information that must be left after the fit of cameras and points; less,
// and what is tested is round-off and priors [-].
constexpr double kLeastLeft = 1e-3;

// A family with its test: what coefficients are estimated as, and the covariance of that.
struct Tested {
  Family family;
  Trend trend;
  ScoreTest::Score score;
  Eigen::VectorXd value;
  Eigen::MatrixXd covariance;
};

// Whether the coefficients' score is larger than chance makes it, and what they are estimated as.
Tested TestFamily(const ScoreTest& test, Family family) {
  Tested out;
  out.trend.kind = family.kind;
  out.trend.camera = family.camera;
  out.score = test.Of(family.columns);
  const Eigen::MatrixXd& M = out.score.covariance;
  const auto m = static_cast<Eigen::Index>(family.prior.size());
  Eigen::VectorXd d = Eigen::VectorXd::Map(family.prior.data(), m);
  out.family = std::move(family);
  out.value = Eigen::VectorXd::Zero(m);
  out.covariance = Eigen::MatrixXd::Zero(m, m);
  for (Eigen::Index k = 0; k < m; ++k) {
    if (M(k, k) < kLeastLeft * out.score.whole(k, k)) d(k) = 0.0;
  }
  // T = s' D s has the mean tr(D M) and the variance 2 tr(D M D M); matched by a multiple of a
  // chi-square variable [Satterthwaite].
  const Eigen::MatrixXd DM = d.asDiagonal() * M;
  const double mean = DM.trace(), square = (DM * DM).trace();
  if (!(mean > 0.0) || !(square > 0.0)) return out;
  const double value = out.score.value.dot(d.asDiagonal() * out.score.value);
  out.trend.chance = ChiSquareTail(value * mean / square, mean * mean / square);
  // Best linear prediction with the variance that gives T its value.
  const double variance = (value - mean) / square;
  if (!(variance > 0.0)) return out;
  const Eigen::VectorXd prior = variance * d;
  const Eigen::MatrixXd I = Eigen::MatrixXd::Identity(m, m);
  const Eigen::MatrixXd C = M * prior.asDiagonal();
  out.covariance = prior.asDiagonal() * (I + C).partialPivLu().solve(I);
  out.value = out.covariance * out.score.value;
  out.trend.rms = out.value.norm();
  out.trend.sigma = std::sqrt(std::max(out.covariance.trace(), 0.0));
  return out;
}

// The part of a sentence that says what was seen.
std::string Seen(const Trend& trend, const std::vector<std::string>& cameras) {
  const std::string camera =
      trend.camera < 0 ? "" : cameras[static_cast<std::size_t>(trend.camera)];
  switch (trend.kind) {
    case TrendKind::kReadingDrift:
      return fmt::format(
          "camera \"{}\": its readings drift over the survey, by {:+.2g} px from the first point "
          "to the last ({:.2g} px RMS)",
          camera, trend.change, trend.rms);
    case TrendKind::kSurveyDrift:
      return fmt::format("the surveyed places drift over the survey, by {} RMS",
                         LengthText(trend.rms));
    case TrendKind::kPattern:
      return fmt::format(
          "camera \"{}\": its readings follow a pattern over the field that its lens model does "
          "not make, {:.2g} px RMS",
          camera, trend.rms);
    case TrendKind::kLensRest:
    case TrendKind::kOutermost:
    case TrendKind::kSurveyShape:
      break;
  }
  return fmt::format(
      "the surveyed places are distorted over the volume, by {} RMS beyond their "
      "sigmas",
      LengthText(trend.rms));
}

// What it may come from, and what to do about it.
const char* Remedy(TrendKind kind) {
  switch (kind) {
    case TrendKind::kReadingDrift:
      return "it moved, or warmed up. Let it warm up and survey again, or measure some of the "
             "first points again at the end";
    case TrendKind::kSurveyDrift:
      return "the station or what carries the points moved. Measure some of the first points again";
    case TrendKind::kPattern:
      return "error bars are too short where it is. Look for a window, a reflection or a wrong "
             "flat field, or give the lens model (--lens, --order)";
    case TrendKind::kLensRest:
    case TrendKind::kOutermost:
    case TrendKind::kSurveyShape:
      break;
  }
  return "check the station's level, its prism and what was measured in which set-up";
}

// Of a drift of readings, the columns counted from the end of the survey: that is where the rig is
// used from.
Columns FromTheEnd(const Eigen::MatrixXd& waves, Columns columns) {
  Eigen::MatrixXd& V = columns.on_readings;
  for (Eigen::Index k = 0; k < V.rows(); ++k) {
    if (!V.row(k).isZero(0.0)) V.row(k) -= waves.bottomRows(1).row(0);
  }
  return columns;
}

// What it does to found points that do not know of it. Estimate and its variance together are the
// second moment of the coefficients.
double RiseOf(const ScoreTest& test, const Eigen::MatrixXd& waves, const Tested& one) {
  const Eigen::MatrixXd moment = one.value * one.value.transpose() + one.covariance;
  if (one.trend.kind == TrendKind::kReadingDrift) {
    const Columns ended = FromTheEnd(waves, one.family.columns);
    return test.RiseOfError({}, test.Of(ended).on_cameras, moment);
  }
  return test.RiseOfError(one.family.columns.on_readings, one.score.on_cameras, moment);
}

std::vector<Tested> TestAll(const Observations& data, const RefinedBundle& bundle,
                            const ScoreTest& test, const Eigen::MatrixXd& waves) {
  std::vector<Tested> out;
  for (int j = 0; j < data.camera_count(); ++j) {
    out.push_back(TestFamily(test, DriftOfReadings(data, test, j, waves)));
    out.back().trend.change = (waves.bottomRows(1) - waves.topRows(1)).row(0).dot(out.back().value);
    out.push_back(TestFamily(test, PatternOf(data, bundle, test, j)));
  }
  out.push_back(TestFamily(test, DriftOfSurvey(data, waves)));
  out.push_back(TestFamily(test, ShapeOfSurvey(data, bundle)));
  return out;
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
    case TrendKind::kLensRest:
      return "rest of the lens";
    case TrendKind::kOutermost:
      return "reading where no others are";
    case TrendKind::kSurveyShape:
      break;
  }
  return "shape of the survey";
}

void TrendOptions::Check() const {
  const RefuseOption refuse("TrendOptions");
  if (!(level > 0.0 && level < 1.0))
    refuse("level", "is not between 0 and 1", "give a probability");
  if (!(harmless >= 0.0) || !std::isfinite(harmless))
    refuse("harmless", "is not a share of the squared error", "give 0 or more");
  if (!(unseen >= 0.0) || !std::isfinite(unseen))
    refuse("unseen", "is not a share of the squared error", "give 0 or more");
  if (!(lens_share >= 0.0 && lens_share <= 1.0))
    refuse("lens_share", "is not between 0 and 1", "give a share of the row");
}

TrendResult TestTrends(const Observations& data, const std::vector<CameraPrior>& priors,
                       const RefinedBundle& bundle, const TrendOptions& options) {
  const ScoreTest test(data, priors, bundle);
  const Eigen::MatrixXd waves = TimeWaves(data.points());
  std::vector<Tested> all = TestAll(data, bundle, test, waves);
  // Sidak's price for having looked so often. One camera's drift shows in the others' residuals at
  // the same points: only the least probable is named.
  const double each = ChanceOfEach(options.level, static_cast<double>(all.size()));
  const Tested* least = nullptr;
  for (Tested& one : all) {
    if (!(one.trend.chance < each)) continue;
    one.trend.rise = RiseOf(test, waves, one);
    // A camera that drifts goes on doing so after the survey.
    const bool harmless =
        one.trend.kind != TrendKind::kReadingDrift && one.trend.rise <= options.harmless;
    if (harmless) {
      one.trend.text =
          fmt::format("{}; it raises squared errors of found points by {:.1g}% of what is stated",
                      Seen(one.trend, data.cameras), 100.0 * one.trend.rise);
    } else if (least == nullptr || one.trend.chance < least->trend.chance) {
      least = &one;
    }
  }
  TrendResult out;
  for (Tested& one : all) {
    if (&one == least) {
      one.trend.found = true;
      one.trend.text = Seen(one.trend, data.cameras) + ": " + Remedy(one.trend.kind);
    }
    out.trends.push_back(one.trend);
  }
  if (least == nullptr || least->trend.kind != TrendKind::kReadingDrift) return out;
  const Columns ended = FromTheEnd(waves, least->family.columns);
  const Eigen::VectorXd drift = ended.on_readings * least->value;
  out.drift_px.assign(drift.data(), drift.data() + drift.size());
  const Eigen::MatrixXd by = test.Of(ended).on_cameras;
  out.covariance = by * least->covariance * by.transpose();
  return out;
}

Observations WithoutDrift(Observations data, const TrendResult& trends) {
  for (std::size_t k = 0; k < trends.drift_px.size(); ++k) {
    data.readings[k].u_px -= trends.drift_px[k];
  }
  return data;
}

}  // namespace unfurl::calib
