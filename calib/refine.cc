#include "calib/refine.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "base/statistics.h"
#include "calib/common_error.h"

namespace unfurl::calib {
namespace {

constexpr double kFloorChance = 0.05;   // below: a camera's readings are worse than stated
constexpr double kSurveyChance = 1e-3;  // the same of the survey
constexpr double kPlausible = 0.25;     // share of gross errors; more say that the model is wrong
constexpr double kMuch = 0.02;          // share of a camera's readings left out
constexpr double kLittleFloor = 0.75;   // of sigma; a total of 1.25: three sigmas of the median's
constexpr double kUseful = 0.1;         // redundancy above which a residual tells of its error

// t^2 with  sum r^2 / (s^2 + t^2) = redundancy,  or 0.
double FloorSquare(const Observations& data, const std::vector<std::size_t>& which,
                   const std::vector<double>& residual, double redundancy) {
  double largest = 0.0;
  const auto sum = [&](double square) {
    double total = 0.0;
    for (const std::size_t k : which) {
      const double s = data.readings[k].s_px;
      total += residual[k] * residual[k] / (s * s + square);
    }
    return total;
  };
  for (const std::size_t k : which) largest = std::max(largest, residual[k] * residual[k]);
  const double stated = sum(0.0);
  if (!(redundancy > 0.0) || stated <= redundancy ||
      ChiSquareTail(stated, redundancy) > kFloorChance) {
    return 0.0;
  }
  double low = 0.0, high = largest * static_cast<double>(which.size()) / redundancy;
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high);
    (sum(middle) > redundancy ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

// Floors from the median of residuals, each over the root of its redundancy: gross errors spoil it
// little. As `otherwise` where a camera has few.
std::vector<double> RobustFloors(const Observations& data, const Redundancy& redundancy,
                                 const BundleSummary& summary, std::vector<double> otherwise) {
  std::vector<std::vector<double>> whole(data.cameras.size()), stated(data.cameras.size());
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    if (redundancy.reading[k] < kUseful || !std::isfinite(summary.residual_px[k])) continue;
    const auto j = static_cast<std::size_t>(data.readings[k].camera);
    whole[j].push_back(std::abs(summary.residual_px[k]) / std::sqrt(redundancy.reading[k]));
    stated[j].push_back(data.readings[k].s_px);
  }
  for (std::size_t j = 0; j < otherwise.size(); ++j) {
    if (static_cast<double>(whole[j].size()) < kFewRedundant) continue;
    const double sigma = 1.4826 * Median(whole[j]);
    const double s = Median(stated[j]);
    otherwise[j] = std::sqrt(std::max(sigma * sigma - s * s, 0.0));
  }
  return otherwise;
}

// Sets floors and factor from the solution; the largest relative change of a reading's variance.
double UpdateVariances(const Observations& data, const RefinedBundle& bundle,
                       Weighting* weighting) {
  const std::size_t cameras = data.cameras.size();
  std::vector<std::vector<std::size_t>> which(cameras);
  std::vector<std::size_t> all;
  std::vector<double> redundant(cameras, 0.0), least(cameras, 1e300);
  double redundant_all = 0.0;
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    if (!(bundle.summary.reading_weight[k] > 0.0)) continue;
    const auto j = static_cast<std::size_t>(data.readings[k].camera);
    which[j].push_back(k);
    all.push_back(k);
    redundant[j] += bundle.redundancy.reading[k];
    redundant_all += bundle.redundancy.reading[k];
    least[j] = std::min(least[j], data.readings[k].s_px);
  }
  // Where much was left out, some of its kind is still in: the median's word against the squares'.
  std::vector<double> out(cameras, 0.0), whole(cameras, 0.0);
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const auto j = static_cast<std::size_t>(data.readings[k].camera);
    whole[j] += 1.0;
    if (!weighting->Uses(k)) out[j] += 1.0;
  }
  const std::vector<double> robust =
      RobustFloors(data, bundle.redundancy, bundle.summary, weighting->floor_px);
  double change = 0.0;
  const double shared = FloorSquare(data, all, bundle.summary.residual_px, redundant_all);
  for (std::size_t j = 0; j < cameras; ++j) {
    double square = redundant[j] < kFewRedundant
                        ? shared
                        : FloorSquare(data, which[j], bundle.summary.residual_px, redundant[j]);
    if (out[j] > kMuch * whole[j]) {
      const bool little = robust[j] < kLittleFloor * least[j];
      square = little ? 0.0 : std::min(square, robust[j] * robust[j]);
    }
    double& floor = weighting->floor_px[j];
    change = std::max(change, std::abs(square - floor * floor) / (least[j] * least[j] + square));
    floor = std::sqrt(square);
  }
  double squares = 0.0, redundant_survey = 0.0;
  for (int i = 0; i < data.points(); ++i) {
    const auto point = static_cast<std::size_t>(i);
    if (!weighting->UsesSurvey(point)) continue;
    const Eigen::Vector3d d = bundle.state.points.col(i) - data.p.col(i);
    squares += d.dot(data.cov[point].llt().solve(d));
    redundant_survey += bundle.redundancy.survey[point];
  }
  double factor = 1.0;
  if (redundant_survey > kFewRedundant && squares > redundant_survey &&
      ChiSquareTail(squares, redundant_survey) < kSurveyChance) {
    factor = std::sqrt(squares / redundant_survey);
  }
  change = std::max(change, std::abs(factor / weighting->survey_factor - 1.0));
  weighting->survey_factor = factor;
  return change;
}

}  // namespace

Weighting StartWeighting(const Observations& data, const std::vector<CameraPrior>& priors,
                         double robust_floor_px, const GrossOptions& options,
                         const BundleState& state, const BundleSummary& summary) {
  const std::size_t cameras = data.cameras.size();
  std::vector<std::vector<double>> stated(cameras);
  for (const Reading& r : data.readings) {
    stated[static_cast<std::size_t>(r.camera)].push_back(r.s_px);
  }
  Weighting trial = EqualWeighting(data, 0.0);
  BundleState scratch = state;
  ChooseGross(Corrected(data, state.common), options, &trial, &scratch);
  std::vector<double> out(cameras, 0.0);
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    if (!trial.Uses(k)) out[static_cast<std::size_t>(data.readings[k].camera)] += 1.0;
  }
  double points_out = 0.0;
  for (const char use : trial.use_survey) points_out += use == 0 ? 1.0 : 0.0;
  const bool survey_plausible = points_out <= kPlausible * static_cast<double>(data.points());

  Weighting start = EqualWeighting(data, robust_floor_px);
  const std::vector<double> robust = RobustFloors(
      data, RedundancyOf(data, priors, start, state, CameraCovariance(summary.information)),
      summary, start.floor_px);
  for (std::size_t j = 0; j < cameras; ++j) {
    const bool plausible =
        survey_plausible && out[j] <= kPlausible * static_cast<double>(stated[j].size());
    start.floor_px[j] = plausible ? 0.0 : robust[j];
  }
  return start;
}

RefinedBundle Refine(const Observations& data, const std::vector<CameraPrior>& priors,
                     const Weighting& weighting, const RefineOptions& options, BundleState state) {
  RefinedBundle out;
  out.weighting = weighting;
  out.state = std::move(state);
  BundleOptions squares;
  squares.loss_width = std::numeric_limits<double>::infinity();
  squares.max_iterations = options.max_iterations;
  squares.function_tolerance = kRough;
  GrossOptions gross = options.gross;
  const auto limited = [&](double share) {
    return std::clamp(share, options.gross.least_share, options.gross.most_share);
  };
  for (int round = 0; round < options.rounds; ++round) {
    bool changed = false;
    if (options.choose_gross) {
      GrossChoice choice =
          ChooseGross(Corrected(data, out.state.common), gross, &out.weighting, &out.state);
      changed = choice.changed;
      gross.reading_share = limited(choice.reading_share);
      gross.survey_share = limited(choice.survey_share);
      out.ambiguous = std::move(choice.ambiguous);
    }
    out.summary = SolveBundle(data, priors, out.weighting, squares, &out.state);
    out.redundancy = RedundancyOf(data, priors, out.weighting, out.state,
                                  CameraCovariance(out.summary.information));
    Weighting next = out.weighting;
    const double change = UpdateVariances(Corrected(data, out.state.common), out, &next);
    if (!changed && round > 0 && change < kSettled) break;
    if (round + 1 < options.rounds) out.weighting = std::move(next);
  }
  squares.function_tolerance = BundleOptions{}.function_tolerance;
  out.summary = SolveBundle(data, priors, out.weighting, squares, &out.state);
  if (options.choose_gross) {
    Weighting trial = out.weighting;
    BundleState scratch = out.state;
    out.price = ChooseGross(Corrected(data, out.state.common), gross, &trial, &scratch).price;
  }
  return out;
}

}  // namespace unfurl::calib
