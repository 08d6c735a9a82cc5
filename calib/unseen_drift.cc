#include "calib/unseen_drift.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <string>

#include "base/length.h"
#include "base/statistics.h"
#include "calib/common_error.h"
#include "calib/score_test.h"
#include "calib/set_up.h"
#include "calib/trend_families.h"

namespace unfurl::calib {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
// From the first to the last of a straight line of unit mean square [-].
constexpr double kSpan = 2.0 * std::numbers::sqrt3;

// With even odds a test at this level finds what adds so much to its chi-square of `freedom`
// degrees: its quantile, less its mean.
double EvenOdds(double level, double freedom) {
  return ChiSquareQuantile(1.0 - level, freedom) - freedom;
}

// A drift along m directions with the information M that the fit leaves of it, and the harm H of
// it: of those that are found with even odds, z' M z = shown, the one with the largest z' H z.
Trend MostHarmful(TrendKind kind, int camera, const Eigen::MatrixXd& M, const Eigen::MatrixXd& H,
                  double shown) {
  Trend out;
  out.kind = kind;
  out.camera = camera;
  out.change = out.rise = kNever;
  const Eigen::LLT<Eigen::MatrixXd> factor(M);
  if (H.size() == 0 || factor.info() != Eigen::Success) return out;
  // z = L^-T y, with |y|^2 = shown.
  const Eigen::MatrixXd by_y = factor.matrixL().solve(H).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      Eigen::MatrixXd(factor.matrixL().solve(by_y)));
  const Eigen::Index last = M.rows() - 1;
  const Eigen::VectorXd z = factor.matrixU().solve(eigen.eigenvectors().col(last));
  out.rise = shown * eigen.eigenvalues()(last);
  out.rms = std::sqrt(shown) * z.norm();
  out.change = kSpan * out.rms;
  return out;
}

// Points in an order that goes with no place: those that the golden ratio's multiples, modulo 1,
// would be sorted to [low discrepancy: Weyl].
std::vector<int> AnyOrder(int points) {
  std::vector<int> out(static_cast<std::size_t>(points));
  std::iota(out.begin(), out.end(), 0);
  const auto key = [](int i) { return std::fmod(i * std::numbers::phi, 1.0); };
  std::sort(out.begin(), out.end(), [&](int a, int b) { return key(a) < key(b); });
  return out;
}

// A drift of places without the rigid motion that it is of each set-up's points: of the first one's
// that is the frame, of each other's the place of its own, which the fit finds and whose error is
// in every error bar. One for all points would leave the frame shifted by what it moved before the
// station was carried on, and call that harm.
Eigen::Matrix3Xd WithoutMotions(const Observations& data, Eigen::Matrix3Xd shift) {
  std::vector<int> of(static_cast<std::size_t>(data.points()), 0);
  const auto set_ups = static_cast<int>(std::max<std::size_t>(data.set_ups.size(), 1));
  for (int k = 1; k < set_ups; ++k) {
    for (const int i : PointsOf(data, k)) of[static_cast<std::size_t>(i)] = k;
  }
  for (int k = 0; k < set_ups; ++k) {
    std::vector<int> mine;
    for (int i = 0; i < data.points(); ++i) {
      if (of[static_cast<std::size_t>(i)] == k) mine.push_back(i);
    }
    shift(Eigen::all, mine) =
        WithoutRigidMotion(data.p(Eigen::all, mine), shift(Eigen::all, mine)).eval();
  }
  return shift;
}

// Of the survey, and of each camera; `line` is of the points, straight over the order of measuring.
std::vector<Trend> LookAt(const Observations& data, const ScoreTest& test,
                          const Eigen::VectorXd& line, double level) {
  std::vector<Trend> out;
  Columns survey = DriftOfSurvey(data, line).columns;
  for (Eigen::Index a = 0; a < 3; ++a) {
    survey.on_survey.middleRows(3 * a, 3) =
        WithoutMotions(data, survey.on_survey.middleRows(3 * a, 3));
  }
  const ScoreTest::Score of_survey = test.Of(survey);
  out.push_back(MostHarmful(TrendKind::kSurveyDrift, -1, of_survey.covariance,
                            test.HarmOf({}, of_survey.on_cameras), EvenOdds(level, 3.0)));
  const auto cameras = static_cast<Eigen::Index>(data.camera_count());
  Columns readings;
  readings.on_readings.setZero(static_cast<Eigen::Index>(data.readings.size()), cameras);
  for (Eigen::Index j = 0; j < cameras; ++j) {
    readings.on_readings.col(j) =
        DriftOfReadings(data, test, static_cast<int>(j), line).columns.on_readings;
  }
  const Eigen::MatrixXd M = test.Of(readings).covariance;
  // Counted from the end of the survey, which is where the rig is used from.
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    if (!test.Uses(k)) continue;
    readings.on_readings(static_cast<Eigen::Index>(k), data.readings[k].camera) -= line.maxCoeff();
  }
  const Eigen::MatrixXd H = test.HarmOf({}, test.Of(readings).on_cameras);
  for (Eigen::Index j = 0; j < cameras && H.size() > 0; ++j) {
    out.push_back(MostHarmful(TrendKind::kReadingDrift, static_cast<int>(j), M.block(j, j, 1, 1),
                              H.block(j, j, 1, 1), EvenOdds(level, 1.0)));
  }
  return out;
}

Trend* WorstOf(std::vector<Trend>* trends) {
  return &*std::max_element(trends->begin(), trends->end(),
                            [](const Trend& a, const Trend& b) { return a.rise < b.rise; });
}

// `by_order`: in another order it would show.
std::string UnseenText(const Trend& trend, const std::vector<std::string>& cameras, bool by_order) {
  const bool never = !std::isfinite(trend.rise);
  const std::string size = never              ? "however far"
                           : trend.camera < 0 ? "by " + LengthText(trend.change)
                                              : fmt::format("by {:.2g} px", trend.change);
  const std::string what =
      trend.camera < 0
          ? fmt::format("a station that moved steadily {} in the course of the survey", size)
          : fmt::format("camera \"{}\" drifting steadily {} in the course of the survey",
                        cameras[static_cast<std::size_t>(trend.camera)], size);
  if (!by_order) {
    return fmt::format(
        "{} might not show, and no error bar holds that: survey more points, by more cameras; or "
        "say that nothing moved, if a back sight and a mark that stays show it (--steady)",
        what);
  }
  return fmt::format(
      "the points were measured in an order that goes with their place: {} might not show, and no "
      "error bar holds that. Measure every second point on the way there and the others on the way "
      "back; or say that nothing moved, if a back sight and a mark that stays show it (--steady); "
      "or, if the file is in another order, give the order of measuring in a column 'time [s]'",
      what);
}

}  // namespace

std::vector<Trend> FindUnseenDrift(const Observations& data, const std::vector<CameraPrior>& priors,
                                   const RefinedBundle& bundle, const TrendOptions& options) {
  const ScoreTest test(data, priors, bundle);
  const Eigen::VectorXd line = TimeWaves(data.points()).col(0);
  // As many tests as TestTrends makes.
  const double level = ChanceOfEach(options.level, 2.0 * data.camera_count() + 2.0);
  std::vector<Trend> out = LookAt(data, test, line, level);
  Trend* worst = WorstOf(&out);
  if (options.steady || !(worst->rise > options.unseen)) return out;
  std::vector<Trend> otherwise = LookAt(data, test, line(AnyOrder(data.points())), level);
  worst->found = true;
  worst->text = UnseenText(*worst, data.cameras, WorstOf(&otherwise)->rise <= options.unseen);
  return out;
}

}  // namespace unfurl::calib
