#include "calib/verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/count.h"
#include "base/dense.h"
#include "base/error.h"
#include "base/length.h"
#include "base/refuse_option.h"
#include "base/statistics.h"
#include "calib/judge_held_out.h"
#include "calib/slips.h"
#include "calib/tally.h"

namespace unfurl::calib {
namespace {

constexpr double kNeedShare = 1.0 / 2000.0;  // NeedOf
constexpr std::size_t kNamed = 12;           // gross errors that the reasons name
// Of a station's coordinates: laser trackers reach some 10 um, and a sight of 100 m with an angle
// of 0.1 mrad misses by 10 mm [m].
constexpr double kFinest = 1e-6, kCoarsest = 0.05;

// Of SetUpEstimate::strain: one sigma of what it strains most.
constexpr double kStrain = 1.0;  // [-]

void JudgeNeed(const CalibrationReport& report, const HeldOutSums& sums,
               const VerdictOptions& options, data::Rig* rig, Tally* tally) {
  const double need = NeedOf(options, *rig);
  rig->checks["need [m]"] = need;
  if (sums.n == 0.0) return;
  const std::string aim =
      fmt::format("{} ({})", LengthText(need),
                  options.need > 0.0 ? "the accuracy asked for"
                                     : "a 2000th of the surveyed box; --need sets another");
  const double typical = Median(sums.own);
  if (typical > options.need_factor_no * need) {
    tally->no.push_back(fmt::format(
        "the predicted error of half of the points exceeds {}, against an aim of {}: more or "
        "better survey points, or crossed lens axes, are needed",
        LengthText(typical), aim));
    return;
  }
  const auto poor = static_cast<double>(
      std::count_if(sums.own.begin(), sums.own.end(), [&](double error) { return error > need; }));
  const double share = (poor + report.held_out_unsolved) / (sums.n + report.held_out_unsolved);
  if (share > options.poor_share) {
    tally->care.push_back(
        fmt::format("at {:.0f}% of the surveyed places the predicted error exceeds {}, or too few "
                    "cameras see them",
                    100.0 * share, aim));
  }
}

void JudgeGross(const CalibrationReport& report, const VerdictOptions& options, data::Rig* rig,
                Tally* tally) {
  int gross = 0;
  for (const CameraReport& camera : report.cameras) gross += camera.gross;
  const auto gross_points = std::count_if(report.survey_weight.begin(), report.survey_weight.end(),
                                          [](double w) { return w < 1.0; });
  const double share =
      std::max(gross / std::max(1.0, static_cast<double>(report.readings.size())),
               static_cast<double>(gross_points) /
                   std::max(1.0, static_cast<double>(report.survey_weight.size())));
  rig->checks["gross_readings [1]"] = gross;
  rig->checks["gross_points [1]"] = static_cast<double>(gross_points);
  const std::string text = fmt::format("{:.0f}% of the data contradict the rest", 100.0 * share);
  if (share > options.gross_no) {
    tally->no.push_back(text);
  } else if (share > options.gross_care) {
    tally->care.push_back(text);
  }
  if (gross == 0 && gross_points == 0) return;
  tally->fine.push_back(
      fmt::format("left out as gross errors, which contradict the rest: {} and {}",
                  Counted(static_cast<std::size_t>(gross), "reading"),
                  Counted(static_cast<std::size_t>(gross_points), "surveyed point")));
  for (std::size_t k = 0; k < report.gross.size() && k < kNamed; ++k) {
    tally->fine.push_back(report.gross[k].text);
  }
  if (report.gross.size() > kNamed) {
    tally->fine.push_back(fmt::format("and {} more gross errors", report.gross.size() - kNamed));
  }
}

void JudgeFit(const CalibrationReport& report, const VerdictOptions& options, data::Rig* rig,
              Tally* tally) {
  const double freedom = report.degrees_of_freedom;
  rig->checks["chi_square_per_dof [1]"] = freedom > 0.0 ? report.chi_square / freedom : 0.0;
  rig->checks["degrees_of_freedom [1]"] = freedom;
  rig->checks["model_floor [px]"] = rig->model_floor_px;
  if (!report.converged) tally->no.push_back("the bundle adjustment did not converge");
  if (freedom < options.fewest_redundant) {
    tally->care.push_back(fmt::format(
        "the data have only {:.0f} degrees of freedom to check the fit with: survey more points",
        freedom));
  }
  if (report.open_terms.taken) {
    tally->fine.push_back(fmt::format(
        "lens terms that \"{}\" leaves out take part as far as the readings leave them open "
        "({:.1g} px RMS): without them squared errors of found points would exceed what is stated "
        "by {:.2g}%",
        report.lens_model, report.open_terms.rms_px, 100.0 * report.open_terms.rise));
  }
  for (std::size_t j = 0; j < report.cameras.size(); ++j) {
    const CameraReport& camera = report.cameras[j];
    if (!(camera.floor_px > 0.0)) continue;
    const std::string floor =
        fmt::format("camera \"{}\": its readings deviate by a further {:.3g} px (model floor)",
                    camera.name, camera.floor_px);
    if (camera.floor_px > options.floor_care * rig->cameras[j].pixels) {
      tally->care.push_back(
          floor + (report.lenses.empty()
                       ? ": the lens model or the stated standard deviations are wrong"
                       : ": its lens is not the one that was calibrated before (refocused, "
                         "exchanged?), or the stated standard deviations are wrong"));
    } else {
      tally->fine.push_back(floor);
    }
  }
}

// The survey's own scatter, and what its station does to all points alike.
void JudgeSurvey(const CalibrationReport& report, const Observations& data,
                 const VerdictOptions& options, data::Rig* rig, Tally* tally) {
  std::vector<double> sigmas;
  for (const Eigen::Matrix3d& cov : data.cov) sigmas.push_back(std::sqrt(cov.trace() / 3.0));
  const double typical = sigmas.empty() ? kFinest : Median(sigmas);
  if (typical < kFinest || typical > kCoarsest) {
    tally->care.push_back(fmt::format(
        "the survey states standard deviations of {}, {}: are they {}? State the unit in the "
        "header, as \"sx [mm]\"",
        LengthText(typical),
        typical < kFinest ? "which no station reaches" : "more than any station's",
        typical < kFinest ? "metres under the name of millimetres"
                          : "millimetres under the name of metres"));
  }
  rig->checks["survey_factor [1]"] = report.survey_factor;
  if (report.survey_factor > 1.0) {
    const std::string factor = fmt::format(
        "the survey scatters {:.2f} times as much as it states; all error bars are widened for it",
        report.survey_factor);
    if (report.survey_factor > options.survey_care) {
      tally->care.push_back(
          factor +
          ". Places of one set-up that are off together do so too, and no error bar holds that: "
          "measure some points from each set-up again; if it is scatter, state larger sigmas");
    } else {
      tally->fine.push_back(factor);
    }
  }
  for (const CommonEstimate& error : report.common) {
    if (!error.set_up.empty()) continue;  // JudgeSetUps
    const bool metres = error.unit == "m";
    const double scale = metres ? 1e3 : 1e6;
    const char* unit = metres ? "mm" : error.unit == "rad" ? "urad" : "ppm";
    const std::string text = fmt::format(
        "the station's {}, common to all points: {:.3g} +- {:.2g} {} (stated: +- {:.2g}), included "
        "in every error bar",
        error.name, scale * error.value, scale * error.sigma, unit, scale * error.stated_sigma);
    // What an estimate with a prior scatters by, if the prior is true.
    const double scatter = std::sqrt(
        std::max(0.0, error.stated_sigma * error.stated_sigma - error.sigma * error.sigma));
    if (std::abs(error.value) > options.common_sigmas * scatter) {
      tally->care.push_back(text +
                            "; it is larger than stated (a prism constant that all points share?): "
                            "state a larger standard deviation and it is estimated");
    } else {
      tally->fine.push_back(text);
    }
  }
}

// Several set-ups of the station, against the first.
void JudgeSetUps(const CalibrationReport& report, data::Rig* rig, Tally* tally) {
  if (report.set_ups.empty()) return;
  double off = 0.0;
  for (const SetUpEstimate& set_up : report.set_ups) {
    off += set_up.off ? 1.0 : 0.0;
    if (set_up.strain > kStrain) {
      tally->care.push_back(TextOf(set_up) +
                            ". That is far more than an orientation's error, and it is taken out "
                            "to first order only: bring its points into the other's frame first");
    } else {
      tally->fine.push_back(TextOf(set_up));
    }
  }
  rig->checks["set_ups_off [1]"] = off;
}

// What the residuals follow that nothing in the model makes, and parts of the field that nothing
// tested.
void JudgeTrends(const CalibrationReport& report, data::Rig* rig, Tally* tally) {
  double found = 0.0;
  for (const Trend& trend : report.trends) {
    if (trend.text.empty()) continue;
    (trend.found ? tally->care : tally->fine).push_back(trend.text);
    found += trend.found ? 1.0 : 0.0;
  }
  rig->checks["trends [1]"] = found;
}

void JudgeCoverage(const CalibrationReport& report, const VerdictOptions& options, data::Rig* rig,
                   Tally* tally) {
  std::vector<double> shares;
  for (std::size_t j = 0; j < report.cameras.size(); ++j) {
    const CameraReport& camera = report.cameras[j];
    shares.push_back(std::max(0.0, camera.high_px - camera.low_px) /
                     std::max(1, rig->cameras[j].pixels));
  }
  if (shares.empty()) return;
  const double share = Median(shares);
  rig->checks["row_covered [1]"] = share;
  // Of a lens that was known before, another survey tested the rest.
  if (share >= options.least_row || !report.lenses.empty()) return;
  tally->care.push_back(fmt::format(
      "the survey covers {:.0f}% of the rows (median of the cameras): what lies beyond the "
      "surveyed "
      "box was not tested, and error bars may be too short there. Survey the volume that is used, "
      "or use nothing outside of what was surveyed",
      100.0 * share));
}

void ListWeak(const CalibrationReport& report, data::Rig* rig, Tally* tally) {
  rig->checks["weak_directions [1]"] = static_cast<double>(report.weak.size());
  for (const WeakDirection& weak : report.weak) {
    if (weak.harmless) continue;
    tally->fine.push_back(fmt::format(
        "camera \"{}\", {}: known to {:.2g} {} only, which moves found points by {}; {}",
        rig->cameras[static_cast<std::size_t>(weak.camera)].name, weak.name, weak.sigma, weak.unit,
        LengthText(weak.point_rms), weak.advice));
  }
  for (const std::string& advice : report.advice) tally->fine.push_back(advice);
}

}  // namespace

void VerdictOptions::Check() const {
  const RefuseOption refuse("VerdictOptions");
  const auto positive = [&](const char* name, double value) {
    if (!(value > 0.0) || !std::isfinite(value)) refuse(name, "is not a positive number");
  };
  const auto share = [&](const char* name, double value) {
    if (!(value > 0.0 && value < 1.0)) refuse(name, "is not between 0 and 1");
  };
  if (!(need >= 0.0) || !std::isfinite(need)) refuse("need", "is not a length");
  positive("need_factor_no", need_factor_no);
  share("poor_share", poor_share);
  share("chance", chance);
  positive("honesty", honesty);
  share("gross_care", gross_care);
  share("gross_no", gross_no);
  if (gross_no < gross_care) refuse("gross_no", "lies below gross_care");
  positive("floor_care", floor_care);
  positive("survey_care", survey_care);
  positive("common_sigmas", common_sigmas);
  share("set_up_level", set_up_level);
  positive("fewest_redundant", fewest_redundant);
  if (!(least_row >= 0.0 && least_row <= 1.0)) refuse("least_row", "is not a share");
}

double NeedOf(const VerdictOptions& options, const data::Rig& rig) {
  if (options.need > 0.0) return options.need;
  return kNeedShare * (rig.volume_high - rig.volume_low).maxCoeff();
}

void Judge(const CalibrationReport& report, const Observations& data, data::Rig* rig,
           const VerdictOptions& options) {
  Tally tally;
  const Slip slip = FindUnitSlip(*rig);
  if (slip.found) tally.no.push_back(slip.what + "; " + slip.remedy);
  const HeldOutSums sums = SumHeldOut(report, data);
  JudgeHeldOut(report, sums, options, rig, &tally);
  JudgeNeed(report, sums, options, rig, &tally);
  JudgeGross(report, options, rig, &tally);
  JudgeFit(report, options, rig, &tally);
  JudgeSurvey(report, data, options, rig, &tally);
  JudgeSetUps(report, rig, &tally);
  JudgeLenses(report.lenses, options.lens_level, &tally);
  JudgeTrends(report, rig, &tally);
  JudgeCoverage(report, options, rig, &tally);
  ListWeak(report, rig, &tally);
  if (report.cameras.size() == 3) {
    tally.care.push_back("with three cameras no reading can be checked against the others");
  }
  Conclude(std::move(tally), rig);
}

}  // namespace unfurl::calib
