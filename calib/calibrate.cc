#include "calib/calibrate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/dense.h"
#include "base/error.h"
#include "base/progress.h"
#include "base/refuse_option.h"
#include "base/text.h"
#include "calib/covariance.h"
#include "calib/held_out.h"
#include "calib/lens_rest.h"
#include "calib/model_floor.h"
#include "calib/moved_late.h"
#include "calib/near_frame.h"
#include "calib/open_terms.h"
#include "calib/outermost.h"
#include "calib/refine.h"
#include "calib/report_fit.h"
#include "calib/set_up_scan.h"
#include "calib/unseen_drift.h"
#include "calib/verdict.h"
#include "measure/camera_model.h"
#include "measure/triangulate.h"

namespace unfurl::calib {
namespace {

// What the loss makes of one point at `p`: its readings and its survey.
double PointCost(const Observations& data, const BundleState& state, std::size_t first, int point,
                 const Eigen::Vector3d& p, double floor_px, double width) {
  const auto i = static_cast<std::size_t>(point);
  const Eigen::Vector3d d = p - data.p.col(point);
  double cost = Loss(d.dot(data.cov[i].llt().solve(d)), SurveyLossWidth(width));
  for (std::size_t k = first; k < data.readings.size() && data.readings[k].point == point; ++k) {
    const Reading& r = data.readings[k];
    const data::RigCamera& camera = state.cameras[static_cast<std::size_t>(r.camera)];
    double u = 0.0;
    // No camera sees what is behind it: as far off as its row is long.
    const double off = measure::Project(camera, p, &u) ? r.u_px - u : camera.pixels;
    const double variance = r.s_px * r.s_px + floor_px * floor_px;
    cost += Loss(off * off / variance, width);
  }
  return cost;
}

// A point starts where the survey has it, or where its readings do if the loss prefers that: then
// the survey is in gross error there, and a loss that redescends would not find out by itself. Nor
// does it prefer what is right where the error is large: the loss of a slip of metres, over tenths
// of a millimetre, is that of two readings that are wrong, and two of four readings may agree with
// it. Four that meet in a point do not by chance, so they have it.
void ChoosePointStarts(const Observations& data, double floor_px, double width,
                       BundleState* state) {
  data::Rig rig;
  rig.cameras = state->cameras;
  rig.model_floor_px = floor_px;
  rig.volume_low = data.p.rowwise().minCoeff();
  rig.volume_high = data.p.rowwise().maxCoeff();
  const measure::Triangulator triangulator(rig);
  const Eigen::Vector3d middle = MiddleOf(data.p);
  std::vector<double> u(rig.cameras.size()), s(rig.cameras.size());
  std::size_t k = 0;
  for (int i = 0; i < data.points(); ++i) {
    std::fill(u.begin(), u.end(), std::numeric_limits<double>::quiet_NaN());
    const std::size_t first = k;
    for (; k < data.readings.size() && data.readings[k].point == i; ++k) {
      u[static_cast<std::size_t>(data.readings[k].camera)] = data.readings[k].u_px;
      s[static_cast<std::size_t>(data.readings[k].camera)] = data.readings[k].s_px;
    }
    measure::PointSolution found = triangulator.Solve(u, s, data.p.col(i));
    if (found.outcome != measure::PointOutcome::kSolved) found = triangulator.Solve(u, s, middle);
    if (found.outcome != measure::PointOutcome::kSolved) continue;
    if (found.readings > 3 && found.chi_square < width * width * (found.readings - 3)) {
      state->points.col(i) = found.p;
      continue;
    }
    if (PointCost(data, *state, first, i, found.p, floor_px, width) <
        PointCost(data, *state, first, i, data.p.col(i), floor_px, width)) {
      state->points.col(i) = found.p;
    }
  }
}

// The box of the points that fit; a gross error of the survey may lie anywhere.
void SetVolume(const Observations& data, const BundleSummary& summary, data::Rig* rig) {
  rig->volume_low.setConstant(std::numeric_limits<double>::infinity());
  rig->volume_high.setConstant(-std::numeric_limits<double>::infinity());
  for (Eigen::Index i = 0; i < data.p.cols(); ++i) {
    if (summary.survey_weight[static_cast<std::size_t>(i)] < 1.0) continue;
    rig->volume_low = rig->volume_low.cwiseMin(data.p.col(i));
    rig->volume_high = rig->volume_high.cwiseMax(data.p.col(i));
  }
}

// The rig that a fit makes of its bundle.
void MakeRig(const Observations& data, RigFit* fit) {
  fit->rig = {};
  fit->rig.cameras = fit->bundle.state.cameras;
  for (std::size_t j = 0; j < fit->rig.cameras.size(); ++j) {
    const double floor = fit->bundle.weighting.floor_px[j];
    fit->rig.cameras[j].floor_px = floor;
    fit->rig.model_floor_px = std::max(fit->rig.model_floor_px, floor);
  }
  const Eigen::Index size =
      data::kCameraParameters * static_cast<Eigen::Index>(fit->rig.cameras.size());
  fit->rig.covariance = CameraCovariance(fit->bundle.summary.information).topLeftCorner(size, size);
  ClearFixed(fit->priors, &fit->rig.covariance);
  SetVolume(data, fit->bundle.summary, &fit->rig);
}

// The fit with the set of lens terms that is asked for, or that cross-validation takes.
void ChooseTerms(const Observations& data, const CalibrateOptions& options, RigFit* fit,
                 CalibrationReport* report) {
  if (!options.guess.known.empty()) {
    report->order = fit->order;
    report->lens_model = "as it was known";
    return;
  }
  if (options.order != kAutomaticOrder) {
    report->order = fit->order;
    report->lens_model =
        measure::OrdersOf(options.guess.lens)[static_cast<std::size_t>(fit->order)].name;
    return;
  }
  OrderOptions choice = options.choice;
  choice.workers = options.workers;
  OrderChoice chosen = ChooseOrder(data, fit->priors, fit->bundle, fit->order, choice);
  const OrderTrial& trial = chosen.trials[static_cast<std::size_t>(chosen.taken)];
  report->order = trial.order;
  report->lens_model = OrderName(trial);
  report->order_chosen = true;
  fit->priors = trial.priors;
  fit->bundle = trial.bundle;
  report->orders = std::move(chosen.trials);
  std::vector<CameraPrior> richest;
  for (const CameraGuess& guess : fit->guesses) richest.push_back(guess.richest);
  report->open_terms = TakeOpenTerms(data, richest, options.refine, &fit->priors, &fit->bundle);
  MakeRig(data, fit);
}

// Tests the residuals for trends. Readings that drift are corrected to the end of the survey,
// camera by camera, the bundle fitted again, and what remains tested once more.
Observations TakeOutDrift(const Observations& data, const CalibrateOptions& options, RigFit* fit,
                          CalibrationReport* report) {
  Observations steady = data;
  const Eigen::Index size = fit->rig.covariance.rows();
  Eigen::MatrixXd added = Eigen::MatrixXd::Zero(size, size);
  for (int round = 0; round <= data.camera_count(); ++round) {
    const TrendResult now = TestTrends(steady, fit->priors, fit->bundle, options.trends);
    report->trends.resize(now.trends.size());
    for (std::size_t k = 0; k < now.trends.size(); ++k) {
      if (!report->trends[k].found) report->trends[k] = now.trends[k];
    }
    if (now.drift_px.empty()) break;
    steady = WithoutDrift(std::move(steady), now);
    added += now.covariance.topLeftCorner(size, size);
    fit->bundle = Refine(steady, fit->priors, fit->bundle.weighting, options.refine,
                         std::move(fit->bundle.state));
    MakeRig(steady, fit);
    fit->rig.covariance += added;
  }
  return steady;
}

// Parts of the survey that are off, where nothing else was found: a cause shows in many tests.
void FindSetUps(const Observations& steady, const TrendOptions& options, RigFit* fit,
                CalibrationReport* report) {
  const auto found = [](const Trend& trend) { return trend.found; };
  if (std::any_of(report->trends.begin(), report->trends.end(), found)) return;
  SetUpScan scan = ScanSetUps(steady, fit->priors, fit->bundle, options);
  fit->rig.covariance += scan.covariance;
  report->trends.push_back(std::move(scan.trend));
}

// Says where a row's length is a guess from the readings.
void NoteRows(const Observations& data, data::Rig* rig) {
  std::vector<std::string> guessed;
  for (std::size_t j = 0; j < rig->cameras.size(); ++j) {
    const bool stated = j < data.pixels.size() && data.pixels[j] > 0;
    if (stated) continue;
    guessed.push_back(fmt::format("{} ({})", rig->cameras[j].name, rig->cameras[j].pixels));
  }
  if (guessed.empty()) return;
  rig->reasons.push_back(
      fmt::format("the survey does not state the sensors' pixels; taken from the highest readings: "
                  "{}. A comment '# pixels: 2160' states them",
                  JoinWords(guessed)));
}

// Level of the test for a pattern beyond which richer lenses are tried: a false alarm costs a fit.
constexpr double kTryRicher = 0.2;

// The cameras whose readings deviate beyond their sigmas: by a floor, by readings that were left
// out, or by a pattern over the field.
std::vector<char> Deviating(const Observations& data, const RigFit& fit) {
  std::vector<char> out(data.cameras.size(), 0);
  for (std::size_t j = 0; j < out.size(); ++j) {
    if (fit.bundle.weighting.floor_px[j] > 0.0) out[j] = 1;
  }
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const auto j = static_cast<std::size_t>(data.readings[k].camera);
    if (!fit.bundle.weighting.Uses(k)) out[j] = 1;
  }
  const std::vector<Trend> trends = TestTrends(data, fit.priors, fit.bundle).trends;
  for (const Trend& trend : trends) {
    if (trend.kind == TrendKind::kPattern &&
        trend.chance * static_cast<double>(trends.size()) < kTryRicher) {
      out[static_cast<std::size_t>(trend.camera)] = 1;
    }
  }
  return out;
}

// Fits once more, from a floor for all cameras, with every term of the lens model for the cameras
// that deviate, or for all where that is asked for. Taken where asked for, or where the data are
// more probable with it, each term being charged with 2 (Akaike).
void TryRichest(const Observations& data, const CalibrateOptions& options, double floor_px,
                BundleState state, RigFit* fit) {
  const int richest = static_cast<int>(measure::OrdersOf(options.guess.lens).size()) - 1;
  const bool asked = options.order > fit->order;
  if (richest <= fit->order || (!asked && options.order != kAutomaticOrder)) return;
  const std::vector<char> richer =
      asked ? std::vector<char>(data.cameras.size(), 1) : Deviating(data, *fit);
  std::vector<CameraPrior> priors = fit->priors;
  double charge = 0.0;
  for (std::size_t j = 0; j < priors.size(); ++j) {
    if (richer[j] == 0) continue;
    priors[j] = fit->guesses[j].richest;
    for (int k = 0; k < static_cast<int>(data::kLensTerms); ++k) {
      charge += fit->priors[j].Fixed(k) && !priors[j].Fixed(k) ? 2.0 : 0.0;
    }
  }
  if (charge == 0.0) return;
  RefinedBundle bundle =
      Refine(data, priors, EqualWeighting(data, floor_px), options.refine, std::move(state));
  if (!asked && !(bundle.price + charge < fit->bundle.price)) return;
  fit->bundle = std::move(bundle);
  fit->priors = std::move(priors);
  fit->order = richest;
}

}  // namespace

RigFit FitHere(const Observations& data, const CalibrateOptions& options,
               const std::string& where) {
  if (data.camera_count() < 3) {
    throw Error(fmt::format("the survey has readings of {} cameras", data.camera_count()), where,
                "three cameras or more are needed to find a point");
  }
  RigFit fit;
  fit.guesses = GuessWithSetUps(data, options.guess, where);
  BundleState start;
  start.points = data.p;
  double start_floor_px = 0.0;
  for (const CameraGuess& guess : fit.guesses) {
    fit.priors.push_back(guess.prior);
    start.cameras.push_back(guess.camera);
    start_floor_px = std::max(start_floor_px, 2.0 * guess.sigma_px);
  }
  ChoosePointStarts(data, start_floor_px, options.bundle.loss_width, &start);
  FlooredBundle robust = SolveWithFloor(data, fit.priors, start_floor_px, options.bundle, start);
  const Weighting weighting = StartWeighting(data, fit.priors, robust.floor_px,
                                             options.refine.gross, robust.state, robust.summary);
  fit.bundle = Refine(data, fit.priors, weighting, options.refine, robust.state);
  // Few gross errors or a lens that fits worse: where readings were left out, and a floor for all
  // would do instead, the more probable of the two fits is taken.
  if (robust.floor_px > 0.0 && fit.bundle.summary.gross_readings() > 0) {
    RefinedBundle floored = Refine(data, fit.priors, EqualWeighting(data, robust.floor_px),
                                   options.refine, robust.state);
    if (floored.price < fit.bundle.price) fit.bundle = std::move(floored);
  }
  fit.order = measure::UsualOrderOf(options.guess.lens);
  if (!options.guess.known.empty()) {
    MakeRig(data, &fit);
    return fit;
  }
  TryRichest(data, options, robust.floor_px, std::move(robust.state), &fit);
  if (options.order >= 0 && options.order < fit.order) {
    fit.order = options.order;
    fit.priors = WithOrder(fit.priors, options.order);
    fit.bundle = FitOrder(data, fit.priors, fit.bundle);
  }
  MakeRig(data, &fit);
  return fit;
}

void CalibrateOptions::Check() const {
  const RefuseOption refuse("CalibrateOptions");
  verdict.Check();
  trends.Check();
  guess.Check();
  refine.gross.Check();
  if (folds < 2) refuse("folds", "is less than 2", "give the parts that are held out in turn");
  if (choice.folds < 2) refuse("choice.folds", "is less than 2", "give 2 or more");
  if (!(choice.gain >= 0.0)) refuse("choice.gain", "is negative", "give nats");
  if (!(bundle.loss_width > 0.0)) refuse("bundle.loss_width", "is not above 0", "give sigmas");
  if (bundle.max_iterations < 1) refuse("bundle.max_iterations", "is below 1", "give some");
  const auto orders = static_cast<int>(measure::OrdersOf(guess.lens).size());
  if (order >= orders || order < kFullOrder) {
    refuse("order", "is none of the lens model's sets of terms", "see measure::OrdersOf");
  }
}

Calibration CalibrateHere(const Observations& data, const CalibrateOptions& options,
                          const std::string& where) {
  options.Check();
  const auto done = [&](double share) {
    ThrowIfInterrupted();
    if (options.progress) options.progress(share);
  };
  // Fit with every term of the lens model, gross errors left out.
  RigFit fit = FitHere(data, options, where);
  done(0.3);
  Calibration out;
  // Its terms: those asked for, or those that cross-validation justifies.
  ChooseTerms(data, options, &fit, &out.report);
  done(0.7);
  const Observations steady = TakeOutDrift(data, options, &fit, &out.report);
  const auto add = [&](const std::vector<Trend>& more) {
    out.report.trends.insert(out.report.trends.end(), more.begin(), more.end());
  };
  add(FindMovedLate(steady, fit.bundle, options.trends.level));
  FindSetUps(steady, options.trends, &fit, &out.report);
  add(FindOutermost(steady, fit.bundle, options.trends));
  add(FindUnseenDrift(steady, fit.priors, fit.bundle, options.trends));
  add(FindLensRest(steady, fit.priors, fit.bundle, fit.rig, options.trends));
  done(0.8);
  out.rig = fit.rig;
  ReportFit(steady, fit, options.verdict.set_up_level, &out.report);
  // What the data leave open, what was left out, and points that took no part.
  CalibrationReport& report = out.report;
  report.weak = FindWeak(out.rig, fit.priors, fit.bundle.summary.information);
  report.gross =
      ExplainGross(Corrected(steady, fit.bundle.state.common), fit.bundle, options.explain);
  report.advice =
      SurveyAdvice(data, fit.bundle.weighting, out.rig, fit.priors, !options.guess.known.empty());
  HeldOutResult held = CheckHeldOut(steady, fit.priors, fit.bundle, options.folds, options.workers);
  report.held_out = std::move(held.points);
  report.held_out_unsolved = held.unsolved;
  report.lenses = CompareLenses(options.guess.known, out.rig);
  Judge(report, data, &out.rig, options.verdict);
  if (options.guess.known.empty()) NoteRows(data, &out.rig);  // else the rig before states them
  done(1.0);
  return out;
}

}  // namespace unfurl::calib
