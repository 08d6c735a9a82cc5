#include "calib/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "base/dense.h"
#include "base/error.h"
#include "base/length.h"
#include "base/refuse_option.h"
#include "calib/bar_slips.h"
#include "calib/check_causes.h"
#include "calib/check_design.h"
#include "calib/check_points.h"
#include "calib/copies.h"
#include "calib/slips.h"
#include "calib/verdict.h"
#include "measure/survey_readings.h"
#include "measure/triangulate.h"

namespace unfurl::calib {
namespace {

double CommonVariance(const Observations& data, Eigen::Index point) {
  double sum = 0.0;
  for (const CommonError& error : data.common) sum += error.shift.col(point).squaredNorm();
  return sum;
}

std::ptrdiff_t FoundOf(const CheckResult& result) {
  return std::count_if(result.points.begin(), result.points.end(),
                       [](const CheckedPoint& point) { return std::isfinite(point.error); });
}

// Whether a check can show an error that matters.
void NoteCoarse(const data::Rig& rig, const CheckOptions& options, CheckResult* result) {
  const double need = NeedOf({.need = options.need}, rig);
  if (!(result->rms_predicted > need)) return;
  result->reasons.push_back(
      fmt::format("this check has a standard deviation of {} itself: it cannot show an error of {}",
                  LengthText(result->rms_predicted), LengthText(need)));
}

void Conclude(const std::string& what, const CheckOptions& options, CheckResult* result) {
  result->invalid = result->chance < options.invalid;
  if (result->chance >= options.doubtful) {
    result->verdict = "still valid";
    result->reasons.push_back(fmt::format(
        "{} agree with the calibration: a valid one gives a misfit as large with a probability of "
        "{:.2g}",
        what, result->chance));
    return;
  }
  result->verdict = result->invalid ? "no longer valid" : "doubtful";
  result->reasons.push_back(
      fmt::format("{} do not agree with the calibration: a valid one gives a misfit as large with "
                  "a probability "
                  "of {:.1g}",
                  what, result->chance));
}

// Errors beside what was predicted of them.
struct RmsOfErrors {
  double squares = 0.0, predicted = 0.0, n = 0.0;
  void Add(double error, double variance) {
    squares += error * error;
    predicted += variance;
    n += 1.0;
  }
  void Finish(CheckResult* result) const {
    result->rms = std::sqrt(squares / std::max(1.0, n));
    result->rms_predicted = std::sqrt(predicted / std::max(1.0, n));
  }
};

// Each surveyed point as its readings place it.
void CheckEachPoint(const Observations& data, const std::vector<Found>& found,
                    CheckResult* result) {
  RmsOfErrors all;
  for (int i = 0; i < data.points(); ++i) {
    const auto point = static_cast<std::size_t>(i);
    CheckedPoint checked{data.ids[point], kUnknown, kUnknown};
    if (found[point].solution.outcome == measure::PointOutcome::kSolved) {
      checked.at = found[point].solution.p;
      checked.error = (found[point].solution.p - data.p.col(i)).stableNorm();
      const double variance = found[point].solution.cov.trace() + found[point].F.squaredNorm() +
                              data.cov[point].trace() + CommonVariance(data, i);
      checked.predicted = std::sqrt(variance);
      all.Add(checked.error, variance);
    }
    result->points.push_back(checked);
  }
  all.Finish(result);
}

// Each placement of the bar, where both ends were found.
void CheckEachLength(const Observations& data, const std::vector<Found>& found, const Bar& bar,
                     CheckResult* result) {
  RmsOfErrors all;
  for (std::size_t a = 0; a + 1 < found.size(); a += 2) {
    const std::size_t b = a + 1;
    CheckedPoint checked{data.ids[a] + " to " + data.ids[b], kUnknown, kUnknown};
    if (found[a].solution.outcome == measure::PointOutcome::kSolved &&
        found[b].solution.outcome == measure::PointOutcome::kSolved) {
      const Eigen::Vector3d along = found[b].solution.p - found[a].solution.p;
      const Eigen::RowVector3d way = along.normalized().transpose();
      const double variance =
          (way * (found[a].solution.cov + found[b].solution.cov) * way.transpose()).value() +
          (way * (found[b].F - found[a].F)).squaredNorm() + bar.sigma * bar.sigma;
      checked.at = 0.5 * (found[a].solution.p + found[b].solution.p);
      checked.error = along.norm() - bar.length;
      checked.predicted = std::sqrt(variance);
      all.Add(checked.error, variance);
    }
    result->points.push_back(checked);
  }
  all.Finish(result);
}

// Each camera's misfits as a shift of all its readings, and what of it would show.
void CheckEachCamera(const data::Rig& rig, const CheckDesign& design, const JointTest& test,
                     const CheckOptions& options, CheckResult* result) {
  const Eigen::MatrixXd shifts = design.Shifts(rig.cameras.size());
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const auto j = static_cast<Eigen::Index>(c);
    CheckedCamera camera{rig.cameras[c].name};
    camera.readings = static_cast<int>(
        std::count(design.camera.begin(), design.camera.end(), static_cast<int>(c)));
    const JointTest::Amount shift = test.AmountOf({0, shifts.col(j)});
    camera.shift_px = shift.value;
    camera.shift_sigma_px = shift.sigma;
    camera.shows_px = test.ShownAmount(shifts, j, options.doubtful);
    result->cameras.push_back(camera);
  }
}

// How far each camera's readings are from what rig and survey predict.
void AddMisfits(const CheckDesign& design, const Observations& data, CheckResult* result) {
  const Eigen::VectorXd variances = design.covariance.Variances();
  for (Eigen::Index k = 0; k < design.misfit.size(); ++k) {
    const auto at = static_cast<std::size_t>(k);
    const double variance = variances(k);
    result->readings.push_back({design.camera[at], design.point[at], data.readings[at].u_px,
                                design.misfit(k), std::sqrt(variance)});
    CheckedCamera& camera = result->cameras[static_cast<std::size_t>(design.camera[at])];
    camera.rms_px += design.misfit(k) * design.misfit(k);
    camera.rms_predicted_px += variance;
  }
  for (CheckedCamera& camera : result->cameras) {
    const double m = std::max(1.0, static_cast<double>(camera.readings));
    camera.rms_px = std::sqrt(camera.rms_px / m);
    camera.rms_predicted_px = std::sqrt(camera.rms_predicted_px / m);
  }
}

// How probable the rest is without each camera and without each point.
void TryWithout(const CheckDesign& design, const JointTest& test, bool bad, CheckResult* result) {
  for (std::size_t c = 0; c < result->cameras.size(); ++c) {
    double& chance = result->cameras[c].chance_without;
    chance = result->chance;
    if (!bad) continue;
    std::vector<const Effect*> mine;
    for (std::size_t r = 0; r < design.camera.size(); ++r) {
      if (design.camera[r] == static_cast<int>(c)) mine.push_back(&design.by_reading[r]);
    }
    if (!mine.empty()) chance = test.ChanceWithoutAll(mine);
  }
  const std::vector<double> without =
      bad ? test.ChancesWithout(design.by_point)
          : std::vector<double>(result->points.size(), result->chance);
  for (std::size_t i = 0; i < without.size(); ++i) result->points[i].chance_without = without[i];
}

// How often the design is made again about what was found moved: what is left of a move
// of a hundredth of the row's field falls by as much each time.
constexpr int kRounds = 4;

// What explains the misfit; of cameras and points that moved far about where they were moved to.
// There design and test are made again, but where that leads nowhere.
template <typename Make>
FoundCauses FindAbout(const data::Rig& rig, const Observations& data,
                      const std::vector<std::size_t>& match, const Make& make,
                      const CheckOptions& options, CheckDesign* design, JointTest* test) {
  const FoundCauses first = FindCauses(rig, *design, *test, options);
  FoundCauses found = first;
  for (int k = 0; k < kRounds; ++k) {
    const Moved moved = MovedBy(rig, data, match, found.causes);
    if (!moved.Any()) break;
    CheckDesign there;
    try {
      there = DesignAbout(moved, rig, data, match, make);
    } catch (const Error&) {
      break;  // moved there, a camera would not see what it read
    }
    const JointTest about(there.misfit, there.covariance);
    found = FindCauses(rig, there, about, options);
    if (!found.explained) continue;
    *design = there;
    *test = about;
  }
  return found.explained ? found : first;
}

// The test of a design, in words.
template <typename Make>
void Test(const data::Rig& rig, const Observations& data, const std::vector<std::size_t>& match,
          bool bar, const std::string& what, const Make& make, CheckDesign design,
          CheckResult* result) {
  JointTest test(design.misfit, design.covariance);
  result->chance = test.ScanChance(design.Shifts(rig.cameras.size()));
  const bool bad = result->chance < result->options.doubtful;
  CheckEachCamera(rig, design, test, result->options, result);
  TryWithout(design, test, bad, result);
  Conclude(what, result->options, result);
  if (bad) {
    const FoundCauses found = FindAbout(rig, data, match, make, result->options, &design, &test);
    NameCauses(rig, design, test, found, data, bar, result);
  }
  NoteShown(result);
  NoteCoarse(rig, result->options, result);
}

// Of each placement end, camera and reading in turn.
MeasuredRows PlacementRows(const Observations& data) {
  MeasuredRows out{"placement", "the readings", {}, {}, kFewestOfABar};
  out.rows.resize(static_cast<std::size_t>(data.points() / 2));
  for (std::size_t i = 0; i < out.rows.size(); ++i) {
    out.names.push_back(data.ids[2 * i] + " to " + data.ids[2 * i + 1]);
  }
  for (const Reading& r : data.readings) {
    std::vector<double>& of = out.rows[static_cast<std::size_t>(r.point / 2)];
    of.insert(of.end(), {static_cast<double>(r.point % 2), static_cast<double>(r.camera), r.u_px});
  }
  return out;
}

// Both ends of each placement, one after the other.
Observations BarEnds(const data::ReadingTable& table, const data::Rig& rig,
                     const std::string& where) {
  std::map<std::string, std::array<Eigen::Index, 2>> placements;
  for (std::size_t k = 0; k < table.id.size(); ++k) {
    const std::string& id = table.id[k];
    if (id.size() < 2 || (id.back() != 'a' && id.back() != 'b')) {
      throw Error(fmt::format("the id '{}' does not end in a or b", id), where,
                  "name the ends of placement 1 of the bar 1a and 1b");
    }
    auto& ends =
        placements.try_emplace(id.substr(0, id.size() - 1), std::array<Eigen::Index, 2>{-1, -1})
            .first->second;
    ends[id.back() == 'a' ? 0 : 1] = static_cast<Eigen::Index>(k);
  }
  Observations out;
  out.cameras = table.cameras;
  out.pixels = table.pixels;
  std::vector<Eigen::Index> rows;
  for (const auto& [name, ends] : placements) {
    if (ends[0] < 0 || ends[1] < 0) {
      throw Error(fmt::format("placement {} of the bar has one end only", name), where,
                  "give both ends, a and b");
    }
    rows.insert(rows.end(), ends.begin(), ends.end());
  }
  out.p.resize(3, static_cast<Eigen::Index>(rows.size()));
  out.p.colwise() = Eigen::Vector3d(0.5 * (rig.volume_low + rig.volume_high));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    out.ids.push_back(table.id[static_cast<std::size_t>(rows[i])]);
    out.cov.emplace_back(Eigen::Matrix3d::Identity());
    for (Eigen::Index c = 0; c < table.u_px.cols(); ++c) {
      if (std::isnan(table.u_px(rows[i], c))) continue;
      out.readings.push_back({static_cast<int>(i), static_cast<int>(c), table.u_px(rows[i], c),
                              table.s_px(rows[i], c)});
    }
  }
  return out;
}

}  // namespace

void CheckOptions::Check() const {
  const RefuseOption refuse("CheckOptions");
  if (!(invalid > 0.0 && invalid < 1.0)) refuse("invalid", "is not between 0 and 1");
  if (!(doubtful >= invalid && doubtful < 1.0)) refuse("doubtful", "is not from `invalid` to 1");
  if (!(need >= 0.0) || !std::isfinite(need)) refuse("need", "is not a length");
  const auto odds = [&](const char* name, double value) {
    if (!(value > 0.0 && value < 1.0)) refuse(name, "is not between 0 and 1");
  };
  odds("camera_odds", camera_odds);
  odds("point_odds", point_odds);
  odds("reading_odds", reading_odds);
  odds("frame_odds", frame_odds);
}

CheckResult CheckPoints(const data::Rig& rig, data::Survey survey, const std::string& where,
                        const CheckOptions& options) {
  if (const std::size_t n = data::SetUpNames(survey).size(); n > 1) {
    throw Error(fmt::format("names {} set-ups, and a check takes all points as one frame's", n),
                where + ":set_up",
                "check the points of each set-up by themselves, or leave the column out");
  }
  measure::FindSurveyReadings(&survey);
  return CheckPoints(rig, FromSurvey(survey, where), where, options);
}

CheckResult CheckPoints(const data::Rig& rig, const Observations& data, const std::string& where,
                        const CheckOptions& options) {
  options.Check();
  const std::vector<std::size_t> match = MatchCameras(rig, data, where);
  if (data.readings.empty()) {
    throw Error("holds no readings", where, "give readings of some points");
  }
  // A file that is written otherwise than it says speaks of itself, not of the rig.
  const Slip slip = FindSlip(rig, data, match);
  if (slip.found) {
    throw Error("fits the rig, but " + slip.what, where, slip.remedy);
  }
  const auto make = [&](const data::Rig& there, const Observations& readings) {
    return DesignOfPoints(there, readings, match, where);
  };
  const std::vector<Found> found = FindPoints(CheckTriangulator(rig), data, match);
  CheckResult result;
  result.options = options;
  CheckEachPoint(data, found, &result);
  const Observations near = Nearer(rig, data, found, result.points);
  const CheckDesign design = make(rig, near);
  const std::string errors =
      FoundOf(result) > 0 ? fmt::format("{} RMS from the survey, {} predicted",
                                        LengthText(result.rms), LengthText(result.rms_predicted))
                          : "of none do three cameras or more agree on a place";
  Test(rig, near, match, false, fmt::format("{} points ({})", near.points(), errors), make, design,
       &result);
  AddMisfits(design, near, &result);
  return result;
}

CheckResult CheckBar(const data::Rig& rig, const data::ReadingTable& readings, const Bar& bar,
                     const std::string& where, const CheckOptions& options) {
  return CheckBar(rig, BarEnds(readings, rig, where), bar, where, options);
}

CheckResult CheckBar(const data::Rig& rig, const Observations& data, const Bar& bar,
                     const std::string& where, const CheckOptions& options) {
  options.Check();
  const std::vector<std::size_t> match = MatchCameras(rig, data, where);
  RefuseCopiedRows(PlacementRows(data), where);
  const measure::Triangulator triangulator = CheckTriangulator(rig);
  const std::vector<Found> found = FindPoints(triangulator, data, match);
  Eigen::Matrix3Xd start = Eigen::Matrix3Xd::Constant(3, data.points(), kUnknown);
  for (Eigen::Index i = 0; i < start.cols(); ++i) {
    // Where planes meet at a small angle, too: the bar's other end and its length hold it.
    const measure::PointSolution& solution = found[static_cast<std::size_t>(i)].solution;
    if (solution.outcome == measure::PointOutcome::kSolved ||
        solution.outcome == measure::PointOutcome::kParallel) {
      start.col(i) = solution.p;
    }
  }
  const auto make = [&](const data::Rig& there, const Observations& readings) {
    return DesignOfBar(there, readings, match, bar, start);
  };
  CheckResult result;
  result.options = options;
  CheckEachLength(data, found, bar, &result);
  Slip slip = FindBarUnitSlip(result.points, bar);
  if (!slip.found) slip = FindBarSlip(triangulator, data, match, bar);
  if (slip.found) throw Error(slip.what, where, slip.remedy);
  const CheckDesign design = make(rig, data);
  if (design.misfit.size() == 0) {
    throw Error("no placement of the bar has more readings than its two ends need", where,
                "place the bar where three cameras or more see both ends");
  }
  const auto whole = FoundOf(result);
  const std::string lengths =
      whole > 0 ? fmt::format(" ({} RMS from {:.6g} m, {} predicted)", LengthText(result.rms),
                              bar.length, LengthText(result.rms_predicted))
                : "";
  Test(rig, data, match, true,
       fmt::format("{} readings of {} placements of the bar, {} of them found whole{},",
                   data.readings.size(), result.points.size(), whole, lengths),
       make, design, &result);
  return result;
}

}  // namespace unfurl::calib
