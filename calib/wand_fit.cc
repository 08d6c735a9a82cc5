#include "calib/wand_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/dense.h"
#include "base/error.h"
#include "base/progress.h"
#include "base/refuse_option.h"
#include "base/statistics.h"
#include "calib/model_order.h"
#include "calib/refine.h"
#include "calib/wand_poses.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

constexpr double kUseful = 0.1;    // redundancy above which a residual tells of its error
constexpr double kSettled = 0.02;  // change of a variance that no longer matters
constexpr int kTelling = 4;        // readings of a mark that check each other
constexpr double kTie = 0.9;       // of the largest residual: which of the two is wrong is open
constexpr double kNear = 0.3;      // change of a variance at which residuals can be judged by it
// Of a variance in a round. Redundancies are those at the variances before; from far off they would
// free one camera of all others.
constexpr double kMostGrowth = 3.0;
constexpr double kFewRedundant = 8.0;  // readings' worth; less, and a camera shares its floor
constexpr double kRough = 1e-7;        // of the cost, until nothing else changes
constexpr int kRobustRounds = 8;       // a floor halves or doubles in each
constexpr double kEnough = 3.0;  // of the readings' sigma: no other start would do much better

WandWeighting EqualWandWeighting(const WandData& data, double floor_px) {
  WandWeighting out;
  out.floor_px.assign(data.cameras.size(), floor_px);
  out.use_reading.assign(data.readings.size(), 1);
  out.use_point_reading.assign(data.points.readings.size(), 1);
  out.use_survey.assign(static_cast<std::size_t>(data.points.points()), 1);
  return out;
}

double MedianSigma(const WandData& data) {
  std::vector<double> s;
  for (const WandReading& r : data.readings) s.push_back(r.s_px);
  return Median(s);
}

// Robust scale of all residuals, each over the root of its redundancy [px].
double RobustScale(const WandSummary& summary, const WandSystem& system) {
  std::vector<double> off;
  for (std::size_t k = 0; k < summary.residual_px.size(); ++k) {
    if (system.redundancy[k] < kUseful || !std::isfinite(summary.residual_px[k])) continue;
    off.push_back(std::abs(summary.residual_px[k]) / std::sqrt(system.redundancy[k]));
  }
  return off.empty() ? std::numeric_limits<double>::infinity() : 1.4826 * Median(off);
}

// Bundles with the loss and one floor for all, which follows the residuals' scale, until it stays.
double RobustWand(const BundleOptions& options, WandFit* fit) {
  const double s = MedianSigma(fit->data);
  double scale = std::numeric_limits<double>::infinity();
  for (int round = 0; round < kRobustRounds; ++round) {
    fit->summary =
        SolveWandBundle(fit->data, fit->priors, fit->weighting, options, &fit->state, &fit->system);
    scale = RobustScale(fit->summary, fit->system);
    if (!std::isfinite(scale)) return scale;
    const double before = fit->weighting.floor_px[0];
    const double floor = std::sqrt(std::max(0.0, scale * scale - s * s));
    fit->weighting.floor_px.assign(fit->data.cameras.size(), floor);
    const double was = std::hypot(before, s), is = std::hypot(floor, s);
    if (std::abs(is - was) < 0.1 * was) break;
  }
  return scale;
}

// A fit of some poses from one guess.
bool StartFit(const WandData& data, const WandGuess& guess, WandFit* fit) {
  fit->data = data;
  fit->priors.clear();
  std::vector<data::RigCamera> cameras;
  double floor = 0.0;
  for (const CameraGuess& camera : guess.cameras) {
    fit->priors.push_back(camera.prior);
    cameras.push_back(camera.camera);
    floor = std::max(floor, 2.0 * camera.sigma_px);
  }
  fit->dropped = StartPoses(cameras, std::vector<double>(cameras.size(), floor), guess.marks,
                            &fit->data, &fit->state);
  fit->weighting = EqualWandWeighting(fit->data, floor);
  return fit->data.pose_count() >= 6;
}

// Every so many-th pose, without surveyed points: what the cameras are first found from.
WandData FewPoses(const WandData& data, int most) {
  std::vector<int> keep;
  const int n = data.pose_count();
  for (int k = 0; k < std::min(n, most); ++k) {
    keep.push_back(static_cast<int>(static_cast<long>(k) * n / std::min(n, most)));
  }
  WandData out = SelectPoses(data, keep);
  out.points = {};
  return out;
}

// The cameras from some poses.
WandFit FitFew(const WandData& data, const WandFitOptions& options, const std::string& where) {
  const WandData few = FewPoses(data, options.search_poses);
  const double enough = kEnough * MedianSigma(few);
  WandFit best;
  double least = std::numeric_limits<double>::infinity();
  const auto take = [&](const WandGuess& guess) {
    WandFit fit;
    if (!StartFit(few, guess, &fit)) return false;
    const double scale = RobustWand(options.bundle, &fit);
    if (scale < least) {
      least = scale;
      best = std::move(fit);
    }
    return least < enough;
  };
  if (options.from.empty()) {
    GuessWand(few, options.guess, options.start, where, take);
  } else {
    take(GuessWandFrom(few, options.from, options.guess, where));
  }
  if (!std::isfinite(least)) {
    throw Error("no poses of the bar fit the cameras that were found", where,
                "give where the cameras stand (--layout) or an earlier rig (--from)");
  }
  return best;
}

// Leaves out, in each pose, the reading that is off by most of its sigmas, and what is off by as
// much at the same mark, or the whole pose where fewer than four remain there; and surveyed places
// and their readings that are off. Whether any.
bool LeaveOut(double sigmas, WandFit* fit) {
  const WandData& data = fit->data;
  const auto size = [&](std::size_t k) {
    const WandReading& r = data.readings[k];
    if (fit->weighting.use_reading[k] == 0) return 0.0;
    if (!std::isfinite(fit->summary.residual_px[k])) return sigmas * 10.0;
    if (fit->system.redundancy[k] < kUseful) return 0.0;
    return std::abs(fit->summary.residual_px[k]) /
           std::sqrt(fit->weighting.Variance(r.camera, r.s_px) * fit->system.redundancy[k]);
  };
  bool any = false;
  for (std::size_t first = 0; first < data.readings.size();) {
    std::size_t end = first, worst = first;
    double most = 0.0;
    for (; end < data.readings.size() && data.readings[end].pose == data.readings[first].pose;
         ++end) {
      const double off = size(end);
      if (off > most) {
        most = off;
        worst = end;
      }
    }
    if (most > sigmas) {
      int rest = 0;
      for (std::size_t k = first; k < end; ++k) {
        if (data.readings[k].mark != data.readings[worst].mark) continue;
        if (size(k) >= kTie * most) fit->weighting.use_reading[k] = 0;
        rest += fit->weighting.use_reading[k];
      }
      // Three planes meet in a point whatever they are: nothing tells which of four was wrong.
      for (std::size_t k = first; k < end && rest < kTelling; ++k) {
        fit->weighting.use_reading[k] = 0;
      }
      any = true;
    }
    first = end;
  }
  const Observations& points = data.points;
  for (std::size_t k = 0; k < points.readings.size(); ++k) {
    const Reading& r = points.readings[k];
    if (fit->weighting.use_point_reading[k] == 0 || fit->system.point_redundancy[k] < kUseful) {
      continue;
    }
    const double variance = fit->weighting.Variance(r.camera, r.s_px);
    const double off = std::abs(fit->summary.point_residual_px[k]) /
                       std::sqrt(variance * fit->system.point_redundancy[k]);
    if (off <= sigmas) continue;
    fit->weighting.use_point_reading[k] = 0;
    any = true;
  }
  const double limit = std::pow(SurveyLossWidth(sigmas), 2);
  for (int i = 0; i < points.points(); ++i) {
    const auto point = static_cast<std::size_t>(i);
    const double redundant = fit->system.survey_redundancy[point] / 3.0;
    if (fit->weighting.use_survey[point] == 0 || redundant < kUseful) continue;
    if (SurveySquare(fit->data.points, fit->state, i) <= limit * redundant) continue;
    fit->weighting.use_survey[point] = 0;
    any = true;
  }
  return any;
}

// The floor of some cameras' readings, at most a doubling of the whole error.
double FloorOfReadings(const WandFit& fit, const std::vector<char>& camera, double* redundant) {
  std::vector<double> sigma, residual;
  double largest = 0.0;
  *redundant = 0.0;
  for (std::size_t k = 0; k < fit.data.readings.size(); ++k) {
    const WandReading& r = fit.data.readings[k];
    if (camera[static_cast<std::size_t>(r.camera)] == 0 || fit.weighting.use_reading[k] == 0 ||
        !std::isfinite(fit.summary.residual_px[k])) {
      continue;
    }
    sigma.push_back(r.s_px);
    residual.push_back(fit.summary.residual_px[k]);
    *redundant += fit.system.redundancy[k];
    largest = std::max(largest, fit.weighting.Variance(r.camera, r.s_px));
  }
  return std::min(FloorSquare(sigma, residual, *redundant), kMostGrowth * largest);
}

// Floors by camera and the bar's unrest by variance components; the largest relative change.
double UpdateVariances(WandFit* fit) {
  const WandData& data = fit->data;
  const std::size_t c = data.cameras.size();
  double change = 0.0, redundant = 0.0;
  const double shared = FloorOfReadings(*fit, std::vector<char>(c, 1), &redundant);
  const double s = MedianSigma(data);
  std::vector<double> floors;
  for (std::size_t j = 0; j < c; ++j) {
    std::vector<char> own(c, 0);
    own[j] = 1;
    const double square = FloorOfReadings(*fit, own, &redundant);
    floors.push_back(std::sqrt(redundant < kFewRedundant ? shared : square));
    const double before = fit->weighting.floor_px[j];
    change = std::max(change, std::abs(floors[j] * floors[j] - before * before) /
                                  (s * s + floors[j] * floors[j]));
  }
  fit->weighting.floor_px = floors;
  if (fit->system.motion_redundancy > 1.0) {
    const double factor = fit->system.motion_squares / fit->system.motion_redundancy;
    fit->weighting.unrest *= factor;
    change = std::max(change, 0.2 * std::abs(std::log(factor)));  // it is known to a few per cent
  }
  return change;
}

void RefineWand(const WandFitOptions& options, WandFit* fit) {
  // While gross errors are found, by the loss, which those that are not yet found pull little.
  BundleOptions rough = options.bundle;
  rough.function_tolerance = kRough;
  for (int round = 0; round < options.rounds; ++round) {
    fit->summary =
        SolveWandBundle(fit->data, fit->priors, fit->weighting, rough, &fit->state, &fit->system);
    if (!LeaveOut(options.gross_sigmas, fit)) break;
  }
  rough.loss_width = std::numeric_limits<double>::infinity();
  fit->settled = false;
  for (int round = 0; round < options.rounds && !fit->settled; ++round) {
    fit->summary =
        SolveWandBundle(fit->data, fit->priors, fit->weighting, rough, &fit->state, &fit->system);
    const double change = UpdateVariances(fit);
    const bool out = change < kNear && LeaveOut(options.gross_sigmas, fit);
    fit->settled = !out && change < kSettled;
  }
  RefitWand(options.bundle, fit);
}

}  // namespace

void WandFitOptions::Check() const {
  const RefuseOption refuse("WandFitOptions");
  guess.Check();
  start.Check();
  if (!(gross_sigmas > 0.0)) refuse("gross_sigmas", "is not above 0", "give sigmas, as 4");
  if (rounds < 1) refuse("rounds", "is below 1", "give some");
  if (search_poses < start.fewest_poses) {
    refuse("search_poses", "lies below start.fewest_poses", "give some hundred");
  }
}

void RefitWand(const BundleOptions& options, WandFit* fit) {
  BundleOptions squares = options;
  squares.loss_width = std::numeric_limits<double>::infinity();
  fit->summary =
      SolveWandBundle(fit->data, fit->priors, fit->weighting, squares, &fit->state, &fit->system);
}

WandFit FitWand(const WandData& data, const WandFitOptions& options, const std::string& where) {
  options.Check();
  const WandData still = AtPoseTimes(data);
  const WandFit few = FitFew(still, options, where);
  // All poses, from the cameras that a few of them gave, as if the bar stood still in each.
  WandFit fit;
  fit.data = still;
  fit.priors = few.priors;
  const std::vector<double>& sigma = few.weighting.floor_px;
  std::vector<int> number(data.cameras.size());
  for (std::size_t j = 0; j < number.size(); ++j) number[j] = static_cast<int>(j);
  const Eigen::Matrix3Xd marks = LocateMarks(AsPoints(still, still.Length()), few.state.cameras,
                                             number, sigma, few.state.middle);
  fit.dropped = StartPoses(few.state.cameras, sigma, marks, &fit.data, &fit.state);
  fit.weighting = EqualWandWeighting(fit.data, sigma[0]);
  TakeFrame(&fit);
  fit.weighting.hold_frame = !fit.by_points;
  RobustWand(options.bundle, &fit);
  // As it moved.
  std::vector<int> keep;
  for (const std::string& pose : fit.data.poses) {
    const auto from = keep.empty() ? 0 : keep.back() + 1;
    keep.push_back(static_cast<int>(std::find(data.poses.begin() + from, data.poses.end(), pose) -
                                    data.poses.begin()));
  }
  fit.data = SelectPoses(data, keep);
  StartMotion(&fit);
  RefineWand(options, &fit);
  return fit;
}

}  // namespace unfurl::calib
