#include "calib/verdict.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/statistics.h"

namespace unfurl::calib {
namespace {

// Held-out errors in units of their prediction: within this probability of chance nothing is said.
constexpr double kChance = 1e-3;
// Mean squared held-out error over its prediction (1 when the covariance is true): above, the error
// bars are wrong by a factor of two or more.
constexpr double kHonestyLimit = 4.0;
// Points to be told apart from errors of this size are what such rigs are for [m].
constexpr double kErrorForCare = 1e-3, kErrorForNo = 10e-3;
// Share of the points that may be worse than kErrorForCare, or have too few readings to be found:
// corners of the volume where three cameras see.
constexpr double kPoorShare = 0.1;
// Share of gross errors that the robust loss stands with some margin.
constexpr double kGrossForCare = 0.05, kGrossForNo = 0.3;
// A floor beyond this says that the lens is not of the model's kind [px].
constexpr double kFloorForCare = 0.3;
// A survey worse than stated by more than this is worth asking why.
constexpr double kSurveyForCare = 1.3;
// A common error of the survey beyond this many sigmas of what its estimate scatters by.
constexpr double kCommonForCare = 4.0;
constexpr std::size_t kNamed = 12;  // gross errors that the reasons name
// Fewer redundant numbers leave chi-square and held-out check little to say.
constexpr double kDofForCare = 30.0;

struct Tally {
  std::vector<std::string> no, care, fine;
};

// Sums over the held-out points: measured, predicted and the survey's squared errors.
struct HeldOutSums {
  double n = 0.0, squares = 0.0, predicted = 0.0, survey = 0.0, nees = 0.0;
  double variance = 0.0;           // of `squares`, if the prediction is true
  std::vector<double> sizes, own;  // |error|, and predicted without the survey's part [m]
};

HeldOutSums Sum(const CalibrationReport& report, const Observations& data) {
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
    sums.own.push_back(std::sqrt(std::max(0.0, point.predicted.trace() - survey)));
  }
  return sums;
}

void JudgeHeldOut(const CalibrationReport& report, const HeldOutSums& sums, data::Rig* rig,
                  Tally* tally) {
  if (sums.n == 0.0) {
    tally->no.push_back("no held-out point could be found from its readings");
    return;
  }
  const double n = sums.n, rms = std::sqrt(sums.squares / n);
  const double upper = NormalQuantile(0.95) * std::sqrt(sums.variance);
  const double ratio = sums.nees / (3.0 * n);
  const double typical = Median(sums.own);
  auto& checks = rig->checks;
  checks["held_out_points [1]"] = n;
  checks["held_out_rms [m]"] = rms;
  checks["held_out_rms_predicted [m]"] = std::sqrt(sums.predicted / n);
  checks["held_out_p95 [m]"] = Quantile(sums.sizes, 0.95);
  checks["held_out_max [m]"] = *std::max_element(sums.sizes.begin(), sums.sizes.end());
  checks["held_out_nees_per_dof [1]"] = ratio;
  checks["own_error_rms [m]"] = std::sqrt(std::max(0.0, sums.squares - sums.survey) / n);
  checks["own_error_rms_at_most [m]"] =
      std::sqrt(std::max(0.0, sums.squares - sums.survey + upper) / n);
  checks["own_error_rms_predicted [m]"] = std::sqrt((sums.predicted - sums.survey) / n);
  checks["own_error_median_predicted [m]"] = typical;

  tally->fine.push_back(fmt::format(
      "{:.0f} points that took no part in the fit were found {:.2f} mm RMS from the "
      "survey (predicted {:.2f} mm, of which the survey's own error is {:.2f} mm)",
      n, 1e3 * rms, 1e3 * std::sqrt(sums.predicted / n), 1e3 * std::sqrt(sums.survey / n)));
  if (ratio > kHonestyLimit) {
    tally->no.push_back(fmt::format(
        "held-out points miss by {:.1f} times what was predicted: the error bars are not to be "
        "believed",
        std::sqrt(ratio)));
  } else if (ChiSquareTail(sums.nees, 3.0 * n) < kChance) {
    tally->care.push_back(fmt::format(
        "held-out points miss by {:.2f} times what was predicted, more than chance explains",
        std::sqrt(ratio)));
  }
  if (typical > kErrorForNo) {
    tally->no.push_back(
        fmt::format("half of the points are predicted to be wrong by more than {:.0f} mm: more or "
                    "better survey points, or crossed lens axes, are needed",
                    1e3 * typical));
    return;
  }
  const auto poor = static_cast<double>(std::count_if(
      sums.own.begin(), sums.own.end(), [](double error) { return error > kErrorForCare; }));
  const double share = (poor + report.held_out_unsolved) / (n + report.held_out_unsolved);
  if (share > kPoorShare) {
    tally->care.push_back(fmt::format(
        "{:.0f}% of the surveyed places are predicted to be wrong by more than {:.0f} mm, or are "
        "seen by too few cameras",
        100.0 * share, 1e3 * kErrorForCare));
  }
}

void JudgeFit(const CalibrationReport& report, data::Rig* rig, Tally* tally) {
  const double per_dof =
      report.degrees_of_freedom > 0.0 ? report.chi_square / report.degrees_of_freedom : 0.0;
  int gross = 0;
  for (const CameraReport& camera : report.cameras) gross += camera.gross;
  const auto gross_points = std::count_if(report.survey_weight.begin(), report.survey_weight.end(),
                                          [](double w) { return w < 1.0; });
  const double share =
      std::max(gross / std::max(1.0, static_cast<double>(report.readings.size())),
               static_cast<double>(gross_points) /
                   std::max(1.0, static_cast<double>(report.survey_weight.size())));
  rig->checks["chi_square_per_dof [1]"] = per_dof;
  rig->checks["degrees_of_freedom [1]"] = report.degrees_of_freedom;
  rig->checks["gross_readings [1]"] = gross;
  rig->checks["gross_points [1]"] = static_cast<double>(gross_points);
  rig->checks["model_floor [px]"] = rig->model_floor_px;

  if (!report.converged) tally->no.push_back("the bundle did not converge");
  if (share > kGrossForNo) {
    tally->no.push_back(fmt::format("{:.0f}% of the data do not fit the rest", 100.0 * share));
  } else if (share > kGrossForCare) {
    tally->care.push_back(fmt::format("{:.0f}% of the data do not fit the rest", 100.0 * share));
  }
  if (gross > 0 || gross_points > 0) {
    tally->fine.push_back(
        fmt::format("{} readings and {} surveyed points do not fit the rest and were left out",
                    gross, gross_points));
    for (std::size_t k = 0; k < report.gross.size() && k < kNamed; ++k) {
      tally->fine.push_back(report.gross[k].text);
    }
    if (report.gross.size() > kNamed) {
      tally->fine.push_back(fmt::format("and {} more of the kind", report.gross.size() - kNamed));
    }
  }
  if (report.degrees_of_freedom < kDofForCare) {
    tally->care.push_back(
        fmt::format("only {:.0f} numbers are left over to check the fit with: survey more points",
                    report.degrees_of_freedom));
  }
  for (const CameraReport& camera : report.cameras) {
    if (!(camera.floor_px > 0.0)) continue;
    const std::string floor =
        fmt::format("camera \"{}\": a model error of {:.3f} px had to be allowed for", camera.name,
                    camera.floor_px);
    if (camera.floor_px > kFloorForCare) {
      tally->care.push_back(floor + ": its lens or its stated errors are not as modelled");
    } else {
      tally->fine.push_back(floor);
    }
  }
  rig->checks["survey_factor [1]"] = report.survey_factor;
  if (report.survey_factor > 1.0) {
    const std::string factor = fmt::format(
        "the survey scatters {:.2f} times as much as it states; all error bars are widened for it",
        report.survey_factor);
    (report.survey_factor > kSurveyForCare ? tally->care : tally->fine).push_back(factor);
  }
  for (const CommonEstimate& error : report.common) {
    const bool metres = error.unit == "m";
    const double scale = metres ? 1e3 : 1e6;
    const char* unit = metres ? "mm" : error.unit == "rad" ? "urad" : "ppm";
    const std::string text = fmt::format(
        "the station's {}, common to all points: {:.3g} +- {:.2g} {} (stated: +- {:.2g}), in every "
        "error bar",
        error.name, scale * error.value, scale * error.sigma, unit, scale * error.stated_sigma);
    // What an estimate with a prior scatters by, if the prior is true.
    const double told = std::sqrt(
        std::max(0.0, error.stated_sigma * error.stated_sigma - error.sigma * error.sigma));
    if (std::abs(error.value) > kCommonForCare * told) {
      tally->care.push_back(text +
                            "; the readings say that it is more than was stated (a prism constant "
                            "that all points share?): state it wider and it is estimated");
    } else {
      tally->fine.push_back(text);
    }
  }
  rig->checks["weak_directions [1]"] = static_cast<double>(report.weak.size());
  for (const WeakDirection& weak : report.weak) {
    if (weak.harmless) continue;
    tally->fine.push_back(fmt::format(
        "camera \"{}\", {}: known to {:.2g} {} only, which moves found points by {:.2g} mm; {}",
        rig->cameras[static_cast<std::size_t>(weak.camera)].name, weak.name, weak.sigma, weak.unit,
        1e3 * weak.point_rms, weak.advice));
  }
  for (const std::string& advice : report.advice) tally->fine.push_back(advice);
}

}  // namespace

void Judge(const CalibrationReport& report, const Observations& data, data::Rig* rig) {
  Tally tally;
  JudgeHeldOut(report, Sum(report, data), rig, &tally);
  JudgeFit(report, rig, &tally);
  if (report.cameras.size() == 3) {
    tally.care.push_back("with three cameras nothing is left over to check a reading with");
  }
  rig->verdict = !tally.no.empty() ? kDoNotUse : !tally.care.empty() ? kWithCare : kGood;
  rig->reasons = tally.no;
  rig->reasons.insert(rig->reasons.end(), tally.care.begin(), tally.care.end());
  rig->reasons.insert(rig->reasons.end(), tally.fine.begin(), tally.fine.end());
}

}  // namespace unfurl::calib
