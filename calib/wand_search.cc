#include "calib/wand_search.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/error.h"
#include "base/pose.h"
#include "base/statistics.h"
#include "calib/model_order.h"
#include "calib/wand_gross.h"
#include "calib/wand_lenses.h"
#include "calib/wand_poses.h"
#include "calib/wand_shape.h"

namespace unfurl::calib {
namespace {

constexpr int kRobustRounds = 8;  // a floor halves or doubles in each
constexpr double kEnough = 3.0;   // of the readings' sigma: no other start would do much better
constexpr double kNowhere = std::numeric_limits<double>::infinity();
// Rounds after which cameras that miss by kFarOff as much are on no good way.
constexpr int kTried = 2;
constexpr double kFarOff = 10.0;     // of kEnough
constexpr double kOtherShape = 5.0;  // of the predicted error of distances: not by chance the same

// Robust scale of all residuals, each over the root of its redundancy [px].
double RobustScale(const WandSummary& summary, const WandSystem& system) {
  std::vector<double> off;
  for (std::size_t k = 0; k < summary.residual_px.size(); ++k) {
    if (system.redundancy[k] < kUsefulRedundancy || !std::isfinite(summary.residual_px[k])) {
      continue;
    }
    off.push_back(std::abs(summary.residual_px[k]) / std::sqrt(system.redundancy[k]));
  }
  return off.empty() ? std::numeric_limits<double>::infinity() : 1.4826 * Median(off);
}

// A fit of some poses from one guess.
bool StartFit(const WandData& data, const WandGuess& guess, const WandFitOptions& options,
              WandFit* fit) {
  fit->data = data;
  fit->priors.clear();
  fit->richest.clear();
  std::vector<data::RigCamera> cameras;
  double floor = 0.0;
  for (const CameraGuess& camera : guess.cameras) {
    fit->priors.push_back(options.order < 0 ? camera.prior
                                            : WithOrder({camera.richest}, options.order)[0]);
    if (options.order < 0) fit->richest.push_back(camera.richest);
    cameras.push_back(camera.camera);
    for (int k = 0; k < static_cast<int>(data::kLensTerms); ++k) {
      if (fit->priors.back().Fixed(k)) cameras.back().terms_px[static_cast<std::size_t>(k)] = 0.0;
    }
    floor = std::max(floor, 2.0 * camera.sigma_px);
  }
  const PosesLeft left = StartPoses(cameras, std::vector<double>(cameras.size(), floor),
                                    guess.marks, {}, &fit->data, &fit->state);
  fit->dropped = static_cast<int>(left.unseen.size() + left.contradicting.size());
  fit->weighting = EqualWandWeighting(fit->data, floor);
  return fit->data.pose_count() >= options.start.fewest_poses;
}

// The same, each camera placed anew at the marks with the lens that is known of it: marks that few
// poses and any lens put where they did lead elsewhere.
bool StartWithLenses(const WandData& data, const WandGuess& guess, const WandFitOptions& options,
                     const std::string& where, WandFit* fit) {
  GuessOptions known = options.guess;
  known.known = options.lenses;
  std::vector<data::RigCamera> cameras;
  for (const CameraGuess& camera : guess.cameras) cameras.push_back(camera.camera);
  try {
    return StartFit(data, GuessWandFrom(data, cameras, known, where), options, fit);
  } catch (const Error&) {  // no camera of that lens fits them
    return false;
  }
}

// Every so many-th pose, without surveyed points: what the cameras are first found from.
WandData FewPoses(const WandData& data, int most) {
  const int n = data.pose_count();
  std::vector<int> keep(static_cast<std::size_t>(std::min(n, most)));
  for (std::size_t k = 0; k < keep.size(); ++k) {
    keep[k] = static_cast<int>(k * static_cast<std::size_t>(n) / keep.size());
  }
  WandData out = SelectPoses(data, keep);
  out.points = {};
  return out;
}

// The bar's ends in all poses, by name: what two fits have in common.
Eigen::Matrix3Xd EndsOf(const WandFit& fit, const std::vector<std::string>& poses) {
  Eigen::Matrix3Xd out(3, 2 * static_cast<Eigen::Index>(poses.size()));
  std::size_t at = 0;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    while (fit.data.poses[at] != poses[k]) ++at;
    const auto column = 2 * static_cast<Eigen::Index>(k);
    const auto pose = static_cast<int>(at);
    out.col(column) = fit.state.Mark(pose, 0, 0.0);
    out.col(column + 1) = fit.state.Mark(pose, fit.data.mark_count() - 1, 0.0);
  }
  return out;
}

// How far the bar's ends of two fits lie from each other, after the best motion or mirror image
// [m].
double Apart(const WandFit& a, const WandFit& b) {
  std::vector<std::string> both;
  std::size_t at = 0;
  for (const std::string& pose : a.data.poses) {  // both are in the order of time
    std::size_t k = at;
    while (k < b.data.poses.size() && b.data.poses[k] != pose) ++k;
    if (k == b.data.poses.size()) continue;
    both.push_back(pose);
    at = k + 1;
  }
  if (both.size() < 3) return std::numeric_limits<double>::infinity();
  const Eigen::Matrix3Xd p = EndsOf(a, both), q = EndsOf(b, both);
  return std::min(FitRigid(p, q).rms, FitRigid(p, -q).rms);
}

// The cost of a fit with a floor, from where it is.
double CostAt(const BundleOptions& options, double floor_px, WandFit* fit) {
  fit->weighting.floor_px.assign(fit->data.cameras.size(), floor_px);
  fit->summary =
      SolveWandBundle(fit->data, fit->priors, fit->weighting, options, &fit->state, &fit->system);
  // A pose that a fit could not begin with counts as much as one that is wholly wrong.
  const double lost = Loss(std::pow(1.0 / kUsefulRedundancy, 4), options.loss_width);
  return fit->summary.cost + 0.5 * lost * fit->dropped;
}

// Of fits that reach the stated residuals the most probable; the others that are as probable and
// another rig are its rivals.
WandSearch Compare(const BundleOptions& options, std::vector<WandFit> fits) {
  double floor = 0.0;
  for (const WandFit& fit : fits) floor = std::max(floor, fit.weighting.floor_px[0]);
  std::vector<double> cost;
  cost.reserve(fits.size());
  for (WandFit& fit : fits) cost.push_back(CostAt(options, floor, &fit));
  const auto least =
      static_cast<std::size_t>(std::min_element(cost.begin(), cost.end()) - cost.begin());
  WandSearch out;
  out.fits = true;
  const std::vector<WandGridPoint> grid = WandGrid(fits[least]);
  const double same = grid.empty()
                          ? std::numeric_limits<double>::infinity()
                          : kOtherShape * DistanceSigma(fits[least].CameraCovariance(), grid);
  for (std::size_t k = 0; k < fits.size(); ++k) {
    const double worse = 2.0 * (cost[k] - cost[least]);
    if (k == least || worse > kPreferred) continue;
    const double apart = Apart(fits[least], fits[k]);
    if (apart > same) out.rivals.push_back({apart, worse});
  }
  out.best = std::move(fits[least]);
  return out;
}

}  // namespace

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

double RobustWand(const BundleOptions& options, WandFit* fit) {
  const double s = MedianSigma(fit->data);
  double scale = std::numeric_limits<double>::infinity();
  for (int round = 0; round < kRobustRounds; ++round) {
    fit->summary =
        SolveWandBundle(fit->data, fit->priors, fit->weighting, options, &fit->state, &fit->system);
    scale = RobustScale(fit->summary, fit->system);
    if (!std::isfinite(scale)) return scale;
    const double before = fit->weighting.floor_px[0];
    const double floor = std::sqrt(std::max(scale * scale - s * s, 0.0));
    fit->weighting.floor_px.assign(fit->data.cameras.size(), floor);
    const double was = std::hypot(before, s), is = std::hypot(floor, s);
    if (std::abs(is - was) < 0.1 * was) break;
    if (round >= kTried && scale > kFarOff * kEnough * s) break;
  }
  return scale;
}

WandSearch SearchWand(const WandData& data, const WandFitOptions& options,
                      const std::string& where) {
  const WandData few = FewPoses(data, options.search_poses);
  const double enough = kEnough * MedianSigma(few);
  WandSearch fallback;
  double least = std::numeric_limits<double>::infinity();
  bool bare = false;  // nothing was left over to tell good cameras from bad ones
  std::vector<WandFit> good;
  const auto keep = [&](WandFit fit, double scale) {
    bare = bare || !std::isfinite(scale);
    if (scale < enough) {
      good.push_back(std::move(fit));
    } else if (scale < least) {
      least = scale;
      fallback.best = std::move(fit);
    }
  };
  const auto take = [&](const WandGuess& guess) {
    WandFit fit;
    double scale = kNowhere;
    if (StartFit(few, guess, options, &fit)) {
      scale = RobustWand(options.bundle, &fit);
      const bool near = scale < enough || !std::isfinite(scale);
      if (!options.lenses.empty() && near) {
        scale = TakeLenses(options.lenses, options.bundle, &fit);
      }
      keep(std::move(fit), scale);
    }
    WandFit again;
    if (!options.lenses.empty() && !(scale < enough) &&
        StartWithLenses(few, guess, options, where, &again)) {
      scale = TakeLenses(options.lenses, options.bundle, &again);
      keep(std::move(again), scale);
    }
    return !good.empty();
  };
  if (options.from.empty()) {
    GuessWand(few, options.guess, options.start, where, take);
  } else {
    take(GuessWandFrom(few, options.from, options.guess, where));
  }
  if (!good.empty()) return Compare(options.bundle, std::move(good));
  if (std::isfinite(least)) return fallback;
  if (bare) {
    throw Error(
        fmt::format("{} poses read by {} cameras leave nothing over to check them with",
                    few.pose_count(), few.camera_count()),
        where,
        "wave the bar through some hundred poses, use more cameras, or give their lenses as "
        "they were calibrated before (--lenses)");
  }
  throw Error("no poses of the bar fit the cameras that were found", where,
              "check that readings and --bar belong together, wave it through more poses, or give "
              "an earlier rig (--from)");
}

}  // namespace unfurl::calib
