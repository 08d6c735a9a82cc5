#include "calib/wand_verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/count.h"
#include "base/dense.h"
#include "base/length.h"
#include "base/statistics.h"
#include "base/text.h"
#include "calib/slips.h"
#include "calib/tally.h"
#include "calib/verdict.h"
#include "calib/wand_gross.h"
#include "calib/wand_search.h"
#include "calib/wand_shape.h"

namespace unfurl::calib {
namespace {

// Of all trend tests together, as TrendOptions: one calibration in a hundred that has none.
constexpr double kTrendLevel = 0.01;

// Of a camera's stated sigma, its floor: the search takes no cameras for found that miss by more.
constexpr double kFarFromStated = 3.0;

// The bar's ends: what of their largest spread counts as a plane, as GuessOptions::flatness [-].
constexpr double kFlatWave = 0.05;

void JudgeLengths(const WandReport& report, const VerdictOptions& options, data::Rig* rig,
                  Tally* tally) {
  const auto n = static_cast<double>(report.lengths.size());
  if (report.lengths.empty()) {
    tally->no.push_back(
        "in no pose that took no part could the bar's ends be found: the planes that the cameras' "
        "readings stand for meet at too small an angle, or too few see a mark. Turn rows against "
        "each other, or move cameras apart");
    return;
  }
  double squares = 0.0, predicted = 0.0, whitened = 0.0;
  for (const WandLength& length : report.lengths) {
    squares += length.error * length.error;
    predicted += length.predicted * length.predicted;
    whitened += std::pow(length.error / length.predicted, 2);
  }
  rig->checks["held_out_lengths [1]"] = n;
  rig->checks["held_out_length_rms [m]"] = std::sqrt(squares / n);
  rig->checks["held_out_length_rms_predicted [m]"] = std::sqrt(predicted / n);
  rig->checks["held_out_length_nees [1]"] = whitened / n;
  tally->fine.push_back(fmt::format(
      "in {} poses that took no part in the fit the bar was found {} RMS from its length "
      "(predicted {})",
      report.lengths.size(), LengthText(std::sqrt(squares / n)),
      LengthText(std::sqrt(predicted / n))));
  if (whitened / n > options.honesty) {
    tally->no.push_back(
        fmt::format("held-out lengths of the bar are off by {:.1f} times what is predicted: the "
                    "calibration's error bars are wrong",
                    std::sqrt(whitened / n)));
  } else if (ChiSquareTail(whitened, n) < options.chance) {
    tally->care.push_back(fmt::format(
        "held-out lengths of the bar are off by {:.2f} times what is predicted, more than chance "
        "explains",
        std::sqrt(whitened / n)));
  }
}

// What the bar's poses leave open, by name, and what they lack.
void JudgeShape(const WandFit& fit, const std::vector<double>& sigmas, const WandReport& report,
                const VerdictOptions& options, data::Rig* rig, Tally* tally) {
  const double need = NeedOf(options, *rig);
  rig->checks["need [m]"] = need;
  rig->checks["distance_sigma [m]"] = report.distance_sigma;
  if (!report.shapes.empty()) rig->checks["widest_strain [1]"] = report.shapes.front().sigma;
  // The bar's own directions: where the least of them lies.
  const Eigen::Matrix3d directions = fit.state.direction * fit.state.direction.transpose() /
                                     std::max<double>(1.0, fit.data.pose_count());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(directions);
  rig->checks["bar_direction_least [1]"] = std::sqrt(std::max(eigen.eigenvalues()(0), 0.0));
  const Eigen::Vector3d least = eigen.eigenvectors().col(0);
  const PointSpread spread = SpreadOf(fit.state.middle);
  const PointSpread ends = SpreadOf(fit.state.Ends());
  const double flatness = ends.sigma(2) / ends.sigma(0);
  rig->checks["bar_flatness [1]"] = flatness;
  if (!(flatness >= kFlatWave)) {
    tally->care.push_back(fmt::format(
        "the bar stayed in one plane, normal ({:.2f}, {:.2f}, {:.2f}): {} RMS off it, {} along it. "
        "Off that plane nothing was tested: move the bar, and turn it, out of it",
        ends.normal.x(), ends.normal.y(), ends.normal.z(), LengthText(ends.sigma(2)),
        LengthText(ends.sigma(0))));
  }
  bool any = false;
  for (const WandShape& shape : report.shapes) {
    if (!(shape.moved > need)) continue;
    const std::string text = fmt::format(
        "{} is known to {:.2g}% only, which moves points at the edge of the volume by {}",
        shape.name, 100.0 * shape.sigma, LengthText(shape.moved));
    const bool hopeless = shape.moved > options.need_factor_no * need;
    (hopeless ? tally->no : tally->care)
        .push_back(shape.by_bar ? text + ": state the bar's length better, or survey points"
                                : text);
    any = any || !shape.by_bar;
  }
  if (any) {
    tally->care.push_back(fmt::format(
        "the bar pointed least along ({:.2f}, {:.2f}, {:.2f}) ({:.0f} degrees from across it, RMS) "
        "and moved least along ({:.2f}, {:.2f}, {:.2f}) ({} RMS, {} across): point it and take it "
        "there, use a longer bar (it is {} long) or more poses",
        least.x(), least.y(), least.z(),
        180.0 / M_PI * std::asin(std::min(1.0, std::sqrt(std::max(eigen.eigenvalues()(0), 0.0)))),
        spread.normal.x(), spread.normal.y(), spread.normal.z(), LengthText(spread.sigma(2)),
        LengthText(spread.sigma(0)), LengthText(fit.data.Length())));
  }
  if (sigmas.empty()) {
    tally->no.push_back("no place of the volume is seen by three cameras that fix it");
    return;
  }
  rig->checks["point_sigma_median [m]"] = Median(sigmas);
  const auto poor = static_cast<double>(
      std::count_if(sigmas.begin(), sigmas.end(), [&](double s) { return s > need; }));
  const std::string aim =
      fmt::format("{} ({})", LengthText(need),
                  options.need > 0.0 ? "the accuracy asked for"
                                     : "a 2000th of the bar's box; --need sets another");
  if (Median(sigmas) > options.need_factor_no * need) {
    tally->no.push_back(
        fmt::format("the predicted error of half of the points exceeds {}, against an aim of {}",
                    LengthText(Median(sigmas)), aim));
  } else if (poor > options.poor_share * static_cast<double>(sigmas.size())) {
    tally->care.push_back(fmt::format("at {:.0f}% of the places the predicted error exceeds {}",
                                      100.0 * poor / static_cast<double>(sigmas.size()), aim));
  }
}

// Whether other cameras would explain the readings, or none do.
void JudgeRivals(const WandFit& fit, const WandReport& report, data::Rig* rig, Tally* tally) {
  rig->checks["rivals [1]"] = static_cast<double>(report.rivals.size());
  const auto widest =
      std::max_element(report.rivals.begin(), report.rivals.end(),
                       [](const WandRival& a, const WandRival& b) { return a.apart < b.apart; });
  if (widest != report.rivals.end()) {
    tally->no.push_back(fmt::format(
        "not determined: other cameras ({} were found) explain the readings as well (chi-square "
        "{:.1f} more) with the bar's ends {} RMS elsewhere. Wave the bar through more places and "
        "directions, or give an earlier rig (--from)",
        report.rivals.size(), widest->worse, LengthText(widest->apart)));
  }
  for (std::size_t j = 0; j < report.cameras.size(); ++j) {
    const double floor = report.cameras[j].floor_px;
    const double stated = MedianSigma(fit.data);
    if (!(floor > kFarFromStated * stated)) continue;
    tally->care.push_back(fmt::format(
        "the residuals of camera \"{}\" are {:.1f} times as large as stated ({:.3g} px): its "
        "readings are worse than that, its lens is not of the model's kind, or other cameras would "
        "explain them better",
        report.cameras[j].name, std::hypot(floor, stated) / stated, stated));
  }
}

void JudgeFit(const WandFit& fit, const WandReport& report, const VerdictOptions& options,
              data::Rig* rig, Tally* tally) {
  const double freedom = report.degrees_of_freedom;
  rig->checks["chi_square_per_dof [1]"] = freedom > 0.0 ? report.chi_square / freedom : 0.0;
  rig->checks["degrees_of_freedom [1]"] = freedom;
  rig->checks["model_floor [px]"] = rig->model_floor_px;
  rig->checks["poses [1]"] = report.poses;
  if (!fit.settled) {
    tally->no.push_back(
        "floors and gross errors did not settle: the readings contradict each other, as those of a "
        "bar that moves between its flashes without their times do");
  }
  if (!report.converged) {
    tally->no.push_back(
        "the bundle adjustment did not converge, as where the poses hardly tell the lenses: wave "
        "the bar through more places and directions, or give the lenses as they were calibrated "
        "before (--lenses)");
  }
  if (freedom < options.fewest_redundant) {
    tally->care.push_back(fmt::format(
        "the data have only {:.0f} degrees of freedom to check the fit with: wave the bar longer",
        freedom));
  }
  for (std::string& trend : WandTrends(fit, kTrendLevel)) tally->care.push_back(std::move(trend));
}

void JudgeGross(const WandFit& fit, const WandReport& report, const VerdictOptions& options,
                data::Rig* rig, Tally* tally) {
  int readings = 0;
  for (const WandCameraReport& camera : report.cameras) readings += camera.readings;
  rig->checks["gross_readings [1]"] = report.gross_readings;
  const double share = report.gross_readings / std::max(1.0, static_cast<double>(readings));
  if (report.gross_readings > 0) {
    const std::string text = fmt::format(
        "left out: {} of {}, which contradict the rest or are of poses where nothing tells which "
        "ones do",
        report.gross_readings, Counted(static_cast<std::size_t>(readings), "reading"));
    (share > options.gross_no     ? tally->no
     : share > options.gross_care ? tally->care
                                  : tally->fine)
        .push_back(text);
  }
  if (report.late > 0) {
    tally->care.push_back(fmt::format(
        "of the last {} poses, from \"{}\" on, {} were left out as a whole or in part: a camera "
        "moved before the bar was put away, and the rig has it as it stood before. Wave the bar "
        "again, or calibrate with the poses since it moved",
        report.late, report.late_from, report.late_left_out));
  }
  if (!report.gross_points.empty()) {
    const std::string text =
        fmt::format("surveyed points that contradict the bar were left out: {}",
                    JoinWords(report.gross_points));
    // Most of them: then it is not they that are wrong one by one, and nothing else counts before.
    if (2 * report.gross_points.size() > static_cast<std::size_t>(fit.data.points.points())) {
      tally->no.insert(tally->no.begin(),
                       "the stated length of the bar, or the station's unit or distance error, is "
                       "wrong, or the points are of another set-up of the cameras: measure the bar "
                       "again; " +
                           text);
    } else {
      tally->care.push_back(text);
    }
  }
  if (fit.by_points && fit.weighting.hold_frame) {
    tally->no.push_back(
        "the surveyed points that agree with the bar are fewer than three or on one line, and fix "
        "no frame: survey them again");
  }
  if (report.gross_point_readings > 0) {
    const std::string text =
        fmt::format("left out: {} of {} of surveyed points, which contradict the rest",
                    report.gross_point_readings,
                    Counted(static_cast<std::size_t>(report.point_readings), "reading"));
    // Those of points that were left out, too, are told with them.
    const bool many = report.gross_point_readings > options.gross_care * report.point_readings;
    (many && report.gross_points.empty() ? tally->care : tally->fine).push_back(text);
  }
  if (report.dropped > 0) {
    tally->fine.push_back("passed over, seen by too few cameras: " +
                          Counted(static_cast<std::size_t>(report.dropped), "pose"));
  }
}

// Floors over the rows, and what of the rows was tested.
void JudgeRows(const WandReport& report, const VerdictOptions& options, data::Rig* rig,
               Tally* tally) {
  std::vector<double> shares;
  for (std::size_t j = 0; j < report.cameras.size(); ++j) {
    const WandCameraReport& camera = report.cameras[j];
    const double row = std::max(1, rig->cameras[j].pixels);
    shares.push_back(std::max(0.0, camera.high_px - camera.low_px) / row);
    if (!(camera.floor_px > 0.0)) continue;
    const std::string floor =
        fmt::format("camera \"{}\": its readings deviate by a further {:.3g} px (model floor)",
                    camera.name, camera.floor_px);
    const bool large = camera.floor_px > options.floor_care * row;
    (large ? tally->care : tally->fine).push_back(floor);
  }
  rig->checks["row_covered [1]"] = Median(shares);
  // Of lenses that were known before, that calibration tested the rest.
  if (report.lenses.empty() && Median(shares) < options.least_row) {
    tally->care.push_back(fmt::format(
        "the bar covered {:.0f}% of the rows (median of the cameras): what lies beyond was not "
        "tested. Take it through all of the volume that is used",
        100.0 * Median(shares)));
  }
}

// What surveyed points say of the bar, against what is stated of it: the fit has a mean of both,
// whose distance from what was stated has as its variance what that lost. Without points it is what
// the readings say of how three marks and more divide the bar.
void JudgeStated(const WandFit& fit, const WandReport& report, const VerdictOptions& options,
                 Tally* tally) {
  const double stated = fit.data.place_sigma;
  const Eigen::Index marks = fit.data.place.size();
  const double level = ChanceOfEach(options.chance, static_cast<double>(marks - 1));
  const double limit = NormalQuantile(1.0 - 0.5 * level);
  for (Eigen::Index m = 1; m < marks; ++m) {
    const double variance = report.place_sigma(m) * report.place_sigma(m);
    const double lost = stated * stated - variance;
    // Points that know the bar ten times worse than is stated of it cannot contradict that.
    if (!(lost > 0.01 * stated * stated)) continue;
    const double off = report.place(m) - (fit.data.place(m) - fit.data.place(0));
    if (std::abs(off) < limit * std::sqrt(lost)) continue;
    if (fit.data.points.points() == 0) {
      tally->no.push_back(ContradictionOf(fit.data, report.place) + "; " + kContradictionRemedy);
      return;
    }
    const double found = off * stated * stated / lost;  // without what was stated
    const double sigma = std::sqrt(variance * stated * stated / lost);
    tally->care.push_back(fmt::format(
        "by the surveyed points mark \"{}\" of the bar is {} +- {} further from the first than the "
        "{} +- {} that are stated: one of the two lengths is wrong, and with it the scale of "
        "everything. Measure the bar again, and look at the station's unit and distance error",
        report.marks[static_cast<std::size_t>(m)], LengthText(found), LengthText(sigma),
        LengthText(fit.data.place(m)), LengthText(stated)));
  }
}

// Cameras that were moved went each its own way: distances that all grew alike are another scale.
void JudgeBefore(const WandReport& report, const VerdictOptions& options, Tally* tally) {
  const KnownScale& by = report.against_before;
  if (!(by.freedom > 0.0)) return;
  const double limit = StudentQuantile(1.0 - 0.5 * options.chance, by.freedom);
  if (!(std::abs(by.scale - 1.0) > limit * by.sigma)) return;
  const bool times = by.scale > 2.0 || by.scale < 0.5;  // no percentage that one reads
  const std::string how =
      times ? fmt::format("{:.3g} times as far from each other as", by.scale)
            : fmt::format("{:.3g} +- {:.2g}% {} each other than", 100.0 * std::abs(by.scale - 1.0),
                          100.0 * by.sigma, by.scale > 1.0 ? "further from" : "nearer to");
  tally->care.push_back(
      "the cameras stand " + how +
      " when their lenses were calibrated, all alike: the stated length of the bar, or that "
      "calibration's scale, is off by as much. Measure the bar again");
}

void JudgeMotion(const WandFit& fit, const WandReport& report, data::Rig* rig, Tally* tally) {
  if (!fit.data.Moves()) return;
  rig->checks["bar_speed [m/s]"] = report.speed;
  rig->checks["motion_sigma [m]"] = report.motion_sigma;
  const std::string text = fmt::format(
      "between its marks' flashes the bar moved at {:.2g} m/s, known well enough for its length to "
      "{} (readings: {})",
      report.speed, LengthText(report.motion_sigma), LengthText(report.reading_sigma));
  if (report.motion_sigma > report.reading_sigma) {
    tally->care.push_back(text +
                          ": it moved too fast for its flashes. Flash the marks sooner after each "
                          "other, record without pauses, or move more slowly");
  } else {
    tally->fine.push_back(text);
  }
}

}  // namespace

void JudgeWand(const WandFit& fit, const std::vector<double>& sigmas, const WandReport& report,
               const VerdictOptions& options, data::Rig* rig) {
  Tally tally;
  const Slip slip = FindUnitSlip(*rig, ScaleFrom::kBar);
  if (slip.found) tally.no.push_back(slip.what + "; " + slip.remedy);
  JudgeRivals(fit, report, rig, &tally);
  JudgeLengths(report, options, rig, &tally);
  JudgeShape(fit, sigmas, report, options, rig, &tally);
  JudgeFit(fit, report, options, rig, &tally);
  JudgeGross(fit, report, options, rig, &tally);
  JudgeRows(report, options, rig, &tally);
  JudgeMotion(fit, report, rig, &tally);
  JudgeStated(fit, report, options, &tally);
  JudgeLenses(report.lenses, options.lens_level, &tally);
  JudgeBefore(report, options, &tally);
  rig->checks["handed [1]"] = report.handed ? 1.0 : 0.0;
  if (!report.handed) {
    tally.care.push_back(
        "whether the rig is its own mirror image no readings tell; distances are right either way. "
        "Give where the cameras were meant to stand (--layout), or four surveyed points that are "
        "not in one plane");
  }
  if (report.cameras.size() == 3) {
    tally.care.push_back("with three cameras no reading can be checked against the others");
  }
  tally.fine.push_back("frame " + report.frame + "; scale by the bar");
  Conclude(std::move(tally), rig);
}

}  // namespace unfurl::calib
