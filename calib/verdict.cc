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
// Share of gross errors that the robust loss stands with some margin.
constexpr double kGrossForCare = 0.05, kGrossForNo = 0.3;
// A floor beyond this says that the lens is not of the model's kind [px].
constexpr double kFloorForCare = 0.3;
// Fewer redundant numbers leave chi-square and held-out check little to say.
constexpr double kDofForCare = 30.0;

struct Tally {
  std::vector<std::string> no, care, fine;
};

void JudgeHeldOut(const CalibrationReport& report, const Observations& data, data::Rig* rig,
                  Tally* tally) {
  double squares = 0.0, predicted = 0.0, survey = 0.0, nees = 0.0, worst = 0.0;
  std::vector<double> sizes;
  for (const HeldOutPoint& point : report.held_out) {
    squares += point.error.squaredNorm();
    predicted += point.predicted.trace();
    survey += data.cov[static_cast<std::size_t>(point.point)].trace();
    nees += point.squared;
    sizes.push_back(point.error.norm());
    worst = std::max(worst, sizes.back());
  }
  const auto n = static_cast<double>(report.held_out.size());
  if (n == 0.0) {
    tally->no.push_back("no held-out point could be found from its readings");
    return;
  }
  const double rms = std::sqrt(squares / n);
  const double own = std::sqrt(std::max(0.0, squares - survey) / n);
  const double own_predicted = std::sqrt((predicted - survey) / n);
  const double ratio = nees / (3.0 * n);
  rig->checks["held_out_points [1]"] = n;
  rig->checks["held_out_rms [m]"] = rms;
  rig->checks["held_out_rms_predicted [m]"] = std::sqrt(predicted / n);
  rig->checks["held_out_rms_without_survey [m]"] = own;
  rig->checks["held_out_rms_without_survey_predicted [m]"] = own_predicted;
  rig->checks["held_out_p95 [m]"] = Quantile(sizes, 0.95);
  rig->checks["held_out_max [m]"] = worst;
  rig->checks["held_out_nees_per_dof [1]"] = ratio;

  tally->fine.push_back(
      fmt::format("{} points that took no part in the fit were found {:.2f} mm RMS from the survey "
                  "(predicted {:.2f} mm, of which the survey's own error is {:.2f} mm)",
                  report.held_out.size(), 1e3 * rms, 1e3 * std::sqrt(predicted / n),
                  1e3 * std::sqrt(survey / n)));
  if (ratio > kHonestyLimit) {
    tally->no.push_back(fmt::format(
        "held-out points miss by {:.1f} times what was predicted: the error bars are not to be "
        "believed",
        std::sqrt(ratio)));
  } else if (ChiSquareTail(nees, 3.0 * n) < kChance) {
    tally->care.push_back(fmt::format(
        "held-out points miss by {:.2f} times what was predicted, more than chance explains",
        std::sqrt(ratio)));
  }
  if (own_predicted > kErrorForNo) {
    tally->no.push_back(
        fmt::format("points are predicted to be wrong by {:.0f} mm RMS: more or "
                    "better survey points, or crossed lens axes, are needed",
                    1e3 * own_predicted));
  } else if (own_predicted > kErrorForCare) {
    tally->care.push_back(
        fmt::format("points are predicted to be wrong by {:.1f} mm RMS", 1e3 * own_predicted));
  }
  if (report.held_out_unsolved > 0) {
    tally->care.push_back(fmt::format("{} points have too few readings to be found from them",
                                      report.held_out_unsolved));
  }
}

void JudgeFit(const CalibrationReport& report, data::Rig* rig, Tally* tally) {
  const double per_dof =
      report.degrees_of_freedom > 0.0 ? report.chi_square / report.degrees_of_freedom : 0.0;
  int gross = 0;
  for (const CameraReport& camera : report.cameras) {
    gross += camera.gross;
    rig->checks[fmt::format("{}.residual_rms [px]", camera.name)] = camera.residual_rms_px;
  }
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
        fmt::format("{} readings and {} surveyed points do not fit the rest and "
                    "count little",
                    gross, gross_points));
  }
  if (report.degrees_of_freedom < kDofForCare) {
    tally->care.push_back(
        fmt::format("only {:.0f} numbers are left over to check the fit with: survey more points",
                    report.degrees_of_freedom));
  }
  const std::string floor =
      fmt::format("a model error of {:.3f} px had to be allowed for", rig->model_floor_px);
  if (rig->model_floor_px > kFloorForCare) {
    tally->care.push_back(floor + ": lens, survey or their stated errors are not as modelled");
  } else if (rig->model_floor_px > 0.0) {
    tally->fine.push_back(floor);
  }
}

}  // namespace

void Judge(const CalibrationReport& report, const Observations& data, data::Rig* rig) {
  Tally tally;
  JudgeHeldOut(report, data, rig, &tally);
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
