#include "calib/judge_held_out.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "base/length.h"
#include "base/statistics.h"

namespace unfurl::calib {
namespace {

void StoreHeldOut(const HeldOutSums& sums, data::Rig* rig) {
  const double n = sums.n, own = std::max(0.0, sums.squares - sums.survey);
  const double upper = NormalQuantile(0.95) * std::sqrt(sums.variance);
  auto& checks = rig->checks;
  checks["held_out_points [1]"] = n;
  checks["held_out_rms [m]"] = std::sqrt(sums.squares / n);
  checks["held_out_rms_predicted [m]"] = std::sqrt(sums.predicted / n);
  checks["held_out_p95 [m]"] = Quantile(sums.sizes, 0.95);
  checks["held_out_max [m]"] = *std::max_element(sums.sizes.begin(), sums.sizes.end());
  checks["held_out_nees_per_dof [1]"] = sums.nees / (3.0 * n);
  checks["own_error_rms [m]"] = std::sqrt(own / n);
  checks["own_error_rms_at_most [m]"] =
      std::sqrt(std::max(sums.squares - sums.survey + upper, 0.0) / n);
  checks["own_error_rms_predicted [m]"] = std::sqrt((sums.predicted - sums.survey) / n);
  checks["own_error_median_predicted [m]"] = Median(sums.own);
}

// By its error over what is predicted of it.
const HeldOutPoint& Worst(const CalibrationReport& report) {
  return *std::max_element(
      report.held_out.begin(), report.held_out.end(),
      [](const HeldOutPoint& a, const HeldOutPoint& b) { return a.squared < b.squared; });
}

}  // namespace

HeldOutSums SumHeldOut(const CalibrationReport& report, const Observations& data) {
  HeldOutSums sums;
  for (const HeldOutPoint& point : report.held_out) {
    const double survey = report.survey_factor * report.survey_factor *
                          data.cov[static_cast<std::size_t>(point.point)].trace();
    sums.n += 1.0;
    sums.squares += point.error.squaredNorm();
    sums.predicted += point.predicted.trace();
    sums.survey += survey;
    sums.nees += point.squared;
    sums.variance += 2.0 * point.predicted.squaredNorm();
    sums.sizes.push_back(point.error.norm());
    sums.own.push_back(std::sqrt(std::max(point.predicted.trace() - survey, 0.0)));
  }
  return sums;
}

void JudgeHeldOut(const CalibrationReport& report, const HeldOutSums& sums,
                  const VerdictOptions& options, data::Rig* rig, Tally* tally) {
  if (sums.n == 0.0) {
    tally->no.push_back("no held-out point could be found from its readings");
    return;
  }
  StoreHeldOut(sums, rig);
  const double n = sums.n, ratio = sums.nees / (3.0 * n);
  tally->fine.push_back(fmt::format(
      "{:.0f} points that took no part in the fit were found {} RMS from the survey (predicted {}, "
      "of which the survey's own error is {})",
      n, LengthText(std::sqrt(sums.squares / n)), LengthText(std::sqrt(sums.predicted / n)),
      LengthText(std::sqrt(sums.survey / n))));
  if (ratio > options.honesty) {
    tally->no.push_back(
        fmt::format("the errors of held-out points are {:.1f} times as large as predicted: the "
                    "calibration's error bars are wrong",
                    std::sqrt(ratio)));
  } else if (ChiSquareTail(sums.nees, 3.0 * n) < options.chance) {
    tally->care.push_back(fmt::format(
        "the errors of held-out points are {:.2f} times as large as predicted, more than chance "
        "explains",
        std::sqrt(ratio)));
  } else if (const HeldOutPoint& worst = Worst(report);
             n * ChiSquareTail(worst.squared, 3.0) < options.chance) {
    tally->care.push_back(fmt::format(
        "point \"{}\", held out, was found {} from where it was surveyed (predicted {}), more than "
        "chance explains: the fit follows it where no others are near, be it right or wrong. "
        "Measure it and places around it again",
        report.ids[static_cast<std::size_t>(worst.point)], LengthText(worst.error.norm()),
        LengthText(std::sqrt(worst.predicted.trace()))));
  } else if (ratio < 1.0 / options.honesty) {
    tally->fine.push_back(fmt::format(
        "the errors of held-out points are {:.1f} times as small as predicted: the stated standard "
        "deviations are too large, and so are the error bars",
        1.0 / std::sqrt(ratio)));
  }
}

}  // namespace unfurl::calib
