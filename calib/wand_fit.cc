#include "calib/wand_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "base/dense.h"
#include "base/error.h"
#include "base/progress.h"
#include "base/refuse_option.h"
#include "base/statistics.h"
#include "calib/copies.h"
#include "calib/open_terms.h"
#include "calib/refine.h"
#include "calib/wand_exchanged.h"
#include "calib/wand_gross.h"
#include "calib/wand_lenses.h"
#include "calib/wand_poses.h"
#include "calib/wand_search.h"
#include "measure/camera_model.h"
#include "measure/lens/lens.h"

namespace unfurl::calib {
namespace {

constexpr double kOfItsOwn = 0.1;  // nor such a share of the standard deviation that it is known to
constexpr double kNear = 0.3;      // change of a variance at which residuals can be judged by it
// Of a variance in a round. Redundancies are those at the variances before; from far off they would
// free one camera of all others.
constexpr double kMostGrowth = 3.0;
constexpr double kFloorSigmas = 1.645;  // of the score: chance reaches as much in 5% of cases
constexpr int kLastIterations = 10;     // times as many for the bundle whose numbers are told [-]
constexpr int kHalvings = 60;           // of a bracket: to the last digit

// Readings that share a floor.
struct FloorReadings {
  std::vector<double> own, residual, redundancy;  // stated variance, squared residual [px^2]; [-]

  // Derivative of twice the log likelihood by the floor's square t, and at chance its standard
  // deviation: sum over readings of (r^2 / v - redundancy) / v with v = s^2 + t.
  double Score(double t, double* spread) const {
    double sum = 0.0, squares = 0.0;
    for (std::size_t k = 0; k < own.size(); ++k) {
      const double v = own[k] + t;
      sum += (residual[k] / v - redundancy[k]) / v;
      squares += 2.0 * redundancy[k] * redundancy[k] / (v * v);
    }
    *spread = std::sqrt(squares);
    return sum;
  }

  // The square of the floor that makes the score 0 [px^2]; 0 where the score without is not above
  // `chance` of its standard deviations. Precise readings count most: of stated sigmas that differ
  // tenfold, the sum of r^2 / v would tell of the coarse ones alone, which are nearly all
  // redundant.
  double Square(double chance) const {
    double spread = 0.0, low = 0.0, high = 0.0;
    if (Score(0.0, &spread) <= chance * spread) return 0.0;
    const double least = std::accumulate(redundancy.begin(), redundancy.end(), 0.0);
    for (const double r : residual) high = std::max(high, r);
    high *= static_cast<double>(own.size()) / least;
    for (int k = 0; k < kHalvings; ++k) {
      const double middle = 0.5 * (low + high);
      (Score(middle, &spread) > 0.0 ? low : high) = middle;
    }
    return 0.5 * (low + high);
  }
};

// The floor of some cameras' readings [px^2], at most a doubling of the whole error.
double FloorOfReadings(const WandFit& fit, double gross_sigmas, double chance,
                       const std::vector<char>& camera, double* redundant) {
  FloorReadings some;
  std::vector<double> whole;
  *redundant = 0.0;
  for (std::size_t k = 0; k < fit.data.readings.size(); ++k) {
    const WandReading& r = fit.data.readings[k];
    const double residual = fit.summary.residual_px[k];
    if (camera[static_cast<std::size_t>(r.camera)] == 0 || fit.weighting.use_reading[k] == 0 ||
        !std::isfinite(residual)) {
      continue;
    }
    const double redundancy = fit.system.redundancy[k];
    whole.push_back(fit.weighting.Variance(r.camera, r.s_px));
    // What is to be left out does not widen the floor that it is judged by.
    const double most = gross_sigmas * gross_sigmas * redundancy * whole.back();
    some.own.push_back(r.s_px * r.s_px);
    some.residual.push_back(std::min(residual * residual, most));
    some.redundancy.push_back(redundancy);
    *redundant += redundancy;
  }
  if (!(*redundant > 0.0)) return 0.0;
  return std::min(some.Square(chance), kMostGrowth * Median(whole));
}

// How floors follow the residuals. Where little is redundant they would come and go for ever, as
// residuals are larger with a floor than without, or one camera's would grow by a little in each
// round as another's fell.
struct FloorCourse {
  // Steps shorter where a floor turns back and longer where it goes on; a floor that was found is
  // not given up for being within chance, and who shares one goes on to.
  bool steady = false;
  std::vector<char> shares;  // of each camera
  std::vector<double> step;  // of the way to what the residuals say, and that way before [-, px^2]
  std::vector<double> way;
  bool settled = false;  // no variance was to change by what matters

  double Step(std::size_t camera, double to) {
    // Half of a way that may lead to and fro; half as far when it did, and half as far again when
    // it went on, so that eight rounds are one [-].
    constexpr double kBegin = 0.5, kBack = 0.5, kOn = 1.5;
    constexpr double kLongest = 8.0;  // what a slow way gains in all the rounds that are left [-]
    double& own = step[camera];
    const double before = std::exchange(way[camera], to);
    if (own == 0.0) {
      own = kBegin;
    } else {
      own = to * before > 0.0 ? std::min(kOn * own, kLongest) : kBack * own;
    }
    return own * to;
  }
};

// Floors by camera and the bar's unrest by variance components; the largest relative change.
double UpdateVariances(double gross_sigmas, FloorCourse* course, WandFit* fit) {
  const WandData& data = fit->data;
  const std::size_t c = data.cameras.size();
  double change = 0.0, redundant = 0.0;
  const double shared =
      FloorOfReadings(*fit, gross_sigmas, kFloorSigmas, std::vector<char>(c, 1), &redundant);
  const double s = MedianSigma(data);
  std::vector<double> floors;
  course->shares.resize(c, 0);
  course->step.resize(c, 0.0);
  course->way.resize(c, 0.0);
  course->settled = true;
  const double all = redundant;
  for (std::size_t j = 0; j < c; ++j) {
    std::vector<char> own(c, 0);
    own[j] = 1;
    const double before = fit->weighting.floor_px[j];
    const double chance = course->steady && before > 0.0 ? 0.0 : kFloorSigmas;
    const double square = FloorOfReadings(*fit, gross_sigmas, chance, own, &redundant);
    if (!course->steady) course->shares[j] = redundant < kFewRedundant ? 1 : 0;
    const double next = course->shares[j] != 0 ? shared : square;
    const double way = next - before * before;
    const double step = course->steady ? course->Step(j, way) : way;
    floors.push_back(std::sqrt(std::max(before * before + step, 0.0)));
    const double own_change = std::abs(way) / (s * s + next);
    change = std::max(change, own_change);
    const double known = std::sqrt(2.0 / (course->shares[j] != 0 ? all : redundant));
    course->settled = course->settled && own_change < std::max(kSettled, kOfItsOwn * known);
  }
  fit->weighting.floor_px = floors;
  if (fit->system.motion_redundancy > 1.0) {
    const double factor = fit->system.motion_squares / fit->system.motion_redundancy;
    fit->weighting.unrest *= factor;
    const double matters = 0.2 * std::abs(std::log(factor));  // it is known to a few per cent
    change = std::max(change, matters);
    course->settled = course->settled && matters < kSettled;
  }
  return change;
}

void RequirePoses(const WandFit& fit, const WandFitOptions& options, const std::string& where) {
  const int left = fit.data.pose_count(), lost = static_cast<int>(fit.lost_poses.size());
  if (left >= options.start.fewest_poses) return;
  throw Error(fmt::format("only {} poses of the bar fit cameras that were found ({} contradict "
                          "them, {} are seen by too few)",
                          left, lost, fit.dropped),
              where,
              fmt::format("wave it through at least {} poses that three cameras see, and check "
                          "that readings and --bar belong together",
                          options.start.fewest_poses));
}

// Least squares of what is believed, in turn with floors, the bar's unrest and gross errors, until
// none of them changes.
void Settle(const WandFitOptions& options, WandFit* fit) {
  BundleOptions rough = options.bundle;
  rough.function_tolerance = kRough;
  fit->settled = false;
  FloorCourse course;
  bool out = true;
  // Where nothing is left out any more floors alone go on, for as many rounds again.
  for (int round = 0;
       !fit->settled && (round < options.rounds || (!out && round < 2 * options.rounds)); ++round) {
    RefitWand(rough, fit);
    course.steady = 3 * round >= options.rounds;
    const double change = UpdateVariances(options.gross_sigmas, &course, fit);
    out = change < kNear && LeaveOut(options.gross_sigmas, fit);
    fit->settled = !out && course.settled;
  }
}

// What the set of terms leaves out, as far as the readings leave it open.
void TakeOpenTerms(const WandFitOptions& options, const std::vector<OpenTerm>& open, WandFit* fit) {
  BundleOptions rough = options.bundle;
  rough.function_tolerance = kRough;
  FloorCourse course;
  const auto refit = [&](const std::vector<CameraPrior>&) {
    RefitWand(rough, fit);
    UpdateVariances(options.gross_sigmas, &course, fit);
    return OpenFit{&fit->state.cameras, fit->CameraCovariance()};
  };
  FitOpenTerms(open, Eigen::VectorXd::Ones(static_cast<Eigen::Index>(open.size())), refit,
               &fit->priors);
}

void RefineWand(const WandFitOptions& options, const std::string& where, WandFit* fit) {
  const std::vector<OpenTerm> open =
      fit->richest.empty() ? std::vector<OpenTerm>{} : ListOpenTerms(fit->priors, fit->richest);
  // With all terms: what the usual ones cannot follow at the rows' ends would go for gross errors
  // there, a layer in each round, until nothing was left to show that the lens does not fit.
  for (const OpenTerm& one : open) {
    fit->priors[static_cast<std::size_t>(one.camera)]
        .term_sigma_px[static_cast<std::size_t>(one.term)] = one.sigma_px;
  }
  // While gross errors are found, by the loss, which those that are not yet found pull little.
  BundleOptions rough = options.bundle;
  rough.function_tolerance = kRough;
  if (!open.empty()) RobustWand(rough, fit);
  for (int round = 0; round < options.rounds; ++round) {
    fit->summary =
        SolveWandBundle(fit->data, fit->priors, fit->weighting, rough, &fit->state, &fit->system);
    if (!LeaveOut(options.gross_sigmas, fit)) break;
  }
  Settle(options, fit);
  if (!open.empty()) {
    TakeOpenTerms(options, open, fit);
    Settle(options, fit);
  }
  DropLostPoses(fit);
  RequirePoses(*fit, options, where);
  // What comes out is to be at its minimum; before it was enough to be near.
  BundleOptions last = options.bundle;
  last.max_iterations *= kLastIterations;
  RefitWand(last, fit);
}

}  // namespace

void WandFitOptions::Check() const {
  const RefuseOption refuse("WandFitOptions");
  guess.Check();
  start.Check();
  if (!(gross_sigmas > 0.0)) refuse("gross_sigmas", "is not above 0", "give sigmas, as 4");
  if (rounds < 1) refuse("rounds", "is below 1", "give some");
  if (order >= static_cast<int>(measure::OrdersOf(guess.lens).size())) {
    refuse("order", "is none of the lens model's", "give one of measure::OrdersOf, or -1");
  }
  if (search_poses < start.fewest_poses) {
    refuse("search_poses", "lies below start.fewest_poses", "give some hundred");
  }
}

Eigen::Index WandFit::CameraNumbers() const {
  return data::kCameraParameters * static_cast<Eigen::Index>(state.cameras.size());
}

Eigen::MatrixXd WandFit::CameraCovariance() const {
  return system.covariance.topLeftCorner(CameraNumbers(), CameraNumbers());
}

void RefitWand(const BundleOptions& options, WandFit* fit) {
  BundleOptions squares = options;
  squares.loss_width = std::numeric_limits<double>::infinity();
  fit->summary =
      SolveWandBundle(fit->data, fit->priors, fit->weighting, squares, &fit->state, &fit->system);
}

namespace {

// Of three marks and more the readings tell how they divide the bar, much better than anybody
// measures it. A stated distance that is wrong, held to while floors are sought, raises them until
// the readings say less than it does; let go first, it contradicts good readings. By much, and
// readings would be left out for it: refused. By less it is told afterwards.
void FreeMarks(const BundleOptions& options, const std::string& where, WandFit* fit) {
  constexpr double kAnyPlace = 0.1;    // of the bar's length: sigma of each distance meanwhile [-]
  constexpr double kNoMeasure = 10.0;  // of the stated sigma: no error of measuring [-]
  const Eigen::Index marks = fit->data.place.size();
  if (marks < 3) return;
  const double stated = fit->data.place_sigma;
  fit->data.place_sigma = std::max(stated, kAnyPlace * fit->data.Length());
  RobustWand(options, fit);
  fit->data.place_sigma = stated;
  const Eigen::VectorXd said = fit->data.place.array() - fit->data.place(0);
  const Eigen::VectorXd place = fit->state.place.array() - fit->state.place(0);
  const Eigen::Index others = fit->system.covariance.rows() - fit->CameraNumbers();
  const Eigen::MatrixXd C = fit->system.covariance.bottomRightCorner(others, others);
  Eigen::Index far = 0;
  said.cwiseAbs().maxCoeff(&far);
  for (Eigen::Index m = 1; m < marks; ++m) {
    if (m == far) continue;
    const double ratio = place(m) / place(far), scale = said(far) / place(far);
    Eigen::VectorXd by = Eigen::VectorXd::Zero(C.rows());
    by(m - 1) = scale;
    by(far - 1) = -ratio * scale;
    const double variance = by.dot(C * by) + stated * stated * (1.0 + ratio * ratio);
    if (!(std::abs(ratio * said(far) - said(m)) > kNoMeasure * std::sqrt(variance))) continue;
    throw Error(ContradictionOf(fit->data, fit->state.place), where, kContradictionRemedy);
  }
}

// The first cameras, or why there are none.
WandSearch FirstCameras(const WandData& data, const WandData& still, const WandFitOptions& options,
                        const std::string& where) {
  try {
    return SearchWand(still, options, where);
  } catch (const Error&) {
    const ExchangedMarks exchanged = FindExchanged(data, options, where);
    if (exchanged.camera < 0) throw;
    throw Error(exchanged.Words(data), where, "exchange that camera's readings of the two marks");
  }
}

}  // namespace

WandFit FitWand(const WandData& given, const WandFitOptions& asked, const std::string& where) {
  asked.Check();
  WandData data = given;
  WandFitOptions options = asked;
  if (!options.lenses.empty()) {
    options.guess.lens = RequireLenses(options.lenses, where, &data);
    options.order = -1;
  }
  const WandData still = AtPoseTimes(data);
  RefuseStillCameras(AsPoints(still, still.Length()), where);
  WandSearch search = FirstCameras(data, still, options, where);
  const WandFit& few = search.best;
  // All poses, from the cameras that a few of them gave, as if the bar stood still in each.
  WandFit fit;
  fit.data = still;
  fit.priors = few.priors;
  fit.rivals = std::move(search.rivals);
  fit.handed = few.handed;
  const std::vector<double>& sigma = few.weighting.floor_px;
  std::vector<int> number(data.cameras.size());
  std::iota(number.begin(), number.end(), 0);
  std::vector<RoughMark> rough;
  const Eigen::Matrix3Xd marks = LocateMarks(AsPoints(still, still.Length()), few.state.cameras,
                                             number, sigma, few.state.Ends(), &rough);
  const PosesLeft left = StartPoses(few.state.cameras, sigma, marks, rough, &fit.data, &fit.state);
  fit.dropped = static_cast<int>(left.unseen.size());
  CountLost(still, left.contradicting, &fit);
  RequirePoses(fit, options, where);
  fit.weighting = EqualWandWeighting(fit.data, sigma[0]);
  TakeFrame(where, &fit);
  fit.weighting.hold_frame = !fit.by_points;
  FreeMarks(options.bundle, where, &fit);
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
  fit.richest = few.richest;
  RefineWand(options, where, &fit);
  return fit;
}

}  // namespace unfurl::calib
