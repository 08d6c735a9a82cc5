#include "calib/refine.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/statistics.h"

namespace unfurl::calib {
namespace {

constexpr double kFloorChance = 0.05;   // below: a camera's readings are worse than stated
constexpr double kSurveyChance = 1e-3;  // the same of the survey
constexpr double kFewRedundant = 8.0;   // readings' worth; less, and a camera shares its floor
constexpr double kSettled = 0.02;       // change of a reading's variance that no longer matters
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
  double change = 0.0;
  const double shared = FloorSquare(data, all, bundle.summary.residual_px, redundant_all);
  for (std::size_t j = 0; j < cameras; ++j) {
    const double square =
        redundant[j] < kFewRedundant
            ? shared
            : FloorSquare(data, which[j], bundle.summary.residual_px, redundant[j]);
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

std::vector<double> RobustFloors(const Observations& data, const std::vector<CameraPrior>& priors,
                                 const Weighting& weighting, const BundleState& state,
                                 const BundleSummary& summary) {
  const Redundancy redundancy =
      RedundancyOf(data, priors, weighting, state, CameraCovariance(summary.information));
  std::vector<std::vector<double>> whole(data.cameras.size()), stated(data.cameras.size());
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    if (redundancy.reading[k] < kUseful || !std::isfinite(summary.residual_px[k])) continue;
    const auto j = static_cast<std::size_t>(data.readings[k].camera);
    whole[j].push_back(summary.residual_px[k] / std::sqrt(redundancy.reading[k]));
    stated[j].push_back(data.readings[k].s_px);
  }
  std::vector<double> out = weighting.floor_px;
  for (std::size_t j = 0; j < out.size(); ++j) {
    if (static_cast<double>(whole[j].size()) < kFewRedundant) continue;
    const double sigma = 1.4826 * [&] {
      for (double& r : whole[j]) r = std::abs(r);
      return Median(whole[j]);
    }();
    const double s = Median(stated[j]);
    out[j] = std::sqrt(std::max(0.0, sigma * sigma - s * s));
  }
  return out;
}

RefinedBundle Refine(const Observations& data, const std::vector<CameraPrior>& priors,
                     const Weighting& weighting, const RefineOptions& options, BundleState state) {
  RefinedBundle out;
  out.weighting = weighting;
  out.state = std::move(state);
  BundleOptions squares;
  squares.loss_width = std::numeric_limits<double>::infinity();
  squares.max_iterations = options.max_iterations;
  for (int round = 0; round < options.rounds; ++round) {
    bool changed = false;
    if (options.choose_gross) {
      GrossChoice choice = ChooseGross(data, options.gross, &out.weighting, &out.state);
      changed = choice.changed;
      out.ambiguous = std::move(choice.ambiguous);
    }
    out.summary = SolveBundle(data, priors, out.weighting, squares, &out.state);
    out.redundancy = RedundancyOf(data, priors, out.weighting, out.state,
                                  CameraCovariance(out.summary.information));
    Weighting next = out.weighting;
    const double change = UpdateVariances(data, out, &next);
    if (!changed && round > 0 && change < kSettled) break;
    if (round + 1 < options.rounds) out.weighting = std::move(next);
  }
  return out;
}

}  // namespace unfurl::calib
