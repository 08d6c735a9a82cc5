#include "calib/initial_guess.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "base/error.h"
#include "base/refuse_option.h"
#include "base/statistics.h"
#include "calib/copies.h"
#include "calib/direct_transform.h"
#include "calib/model_order.h"
#include "measure/camera_model.h"
#include "measure/lens/lens.h"

namespace unfurl::calib {
namespace {

constexpr double kLeastCondition = 1e-4;  // of the direct transform: below, another fits as well
constexpr double kLeastInFront = 0.6;     // share of a camera's points that must lie before it
constexpr double kLargestScale = 0.05;    // robust residual over the readings' own spread

void RefuseLine(const Eigen::Matrix3Xd& p, double flatness, const std::string& what,
                const std::string& where) {
  const PointSpread spread = SpreadOf(p);
  if (spread.sigma(0) > 0.0 && spread.sigma(1) >= flatness * spread.sigma(0)) return;
  throw Error(fmt::format("{} are collinear: {:.3g} mm across their line, {:.3g} mm along it", what,
                          1e3 * spread.sigma(1), 1e3 * spread.sigma(0)),
              where, "survey points that fill the volume");
}

void RefuseFlat(const Eigen::Matrix3Xd& p, double flatness, const std::string& what,
                const std::string& where) {
  RefuseLine(p, flatness, what, where);
  const PointSpread spread = SpreadOf(p);
  if (spread.sigma(2) < flatness * spread.sigma(0)) {
    throw Error(
        fmt::format("{} are coplanar: {:.3g} mm out of the plane with normal ({:.2f}, {:.2f}, "
                    "{:.2f}), {:.3g} mm along it",
                    what, 1e3 * spread.sigma(2), spread.normal(0), spread.normal(1),
                    spread.normal(2), 1e3 * spread.sigma(0)),
        where, "survey some points well off that plane");
  }
}

// Of each term: the standard deviation that the lens model states, at the edge of the field that
// the points fill. `pitch` of the pixels [m], 0: not stated.
CameraPrior MakePrior(const data::RigCamera& camera, const Eigen::Matrix3Xd& p, double pitch,
                      const GuessOptions& options) {
  constexpr double kCentresShare = 0.01;   // of the distance, as e: 3 cm at 3 m [-]
  constexpr double kCentresScatter = 0.1;  // of the distance: a lens in a room of 0.2 m has 13% [-]
  const Eigen::Vector3d centre = p.rowwise().mean();
  const double distance = (centre - camera.p_WC).norm();
  CameraPrior prior;
  prior.lens = camera.lens;
  if (options.e_sigma > 0.0) {
    prior.e_mean = options.e_mean;
    prior.e_sigma = options.e_sigma;
  } else if (pitch > 0.0) {
    prior.e_mean = prior.e_sigma = camera.f_px * pitch;
  } else {
    prior.e_mean = kCentresShare * distance;
    prior.e_sigma = kCentresScatter * distance;
  }
  prior.axis = camera.R_CW.row(1);
  prior.along = prior.axis.dot(centre);
  prior.along_sigma = options.along_sigma_share * distance;

  const Eigen::Matrix3Xd p_C = camera.R_CW * (p.colwise() - camera.p_WC);
  std::vector<double> xs, ys;
  for (Eigen::Index i = 0; i < p_C.cols(); ++i) {
    if (p_C(2, i) <= 0.0) continue;
    xs.push_back(std::abs(p_C(0, i) / p_C(2, i)));
    ys.push_back(std::abs(p_C(1, i) / p_C(2, i)));
  }
  // The edge by a quantile: gross errors of the survey reach further.
  const measure::LensImage edge = measure::EvaluateLens(
      camera.lens, Quantile(xs, 0.95), Quantile(ys, 0.95), camera.f_px, camera.terms_px.data());
  const auto share = measure::PriorOf(camera.lens);
  for (std::size_t k = 0; k < prior.term_sigma_px.size(); ++k) {
    if (share[k] == 0.0) continue;  // no such term
    prior.term_unit_px[k] = 1.0 / std::abs(edge.du_dt[k]);
    prior.term_sigma_px[k] = options.term_sigmas * share[k] * camera.pixels * prior.term_unit_px[k];
  }
  return prior;
}

// The direct transform of readings as an ideal lens of the model would give them.
struct DirectGuess {
  RobustDirectFit fit;
  data::RigCamera camera;
};

// Readings of a lens that is no pinhole are straightened first, which takes its image scale: a
// scale after another is tried, from a field of 170 degrees down to one so narrow that every lens
// is a pinhole, and the camera that misses the readings least is taken. The optical axis is first
// thought to meet the row in the middle.
DirectGuess GuessDirect(const Eigen::Matrix3Xd& p, const Eigen::VectorXd& u, int row,
                        data::LensModel lens, const Rng& rng) {
  const Eigen::Vector3d centre = p.rowwise().mean();
  DirectGuess best;
  if (measure::IsStraight(lens)) {
    best.fit = FitDirectRobust(p, u, rng);
    best.camera = CameraFromDirect(best.fit.fit.transform, centre);
    return best;
  }
  constexpr double kWidest = 1.48, kNarrowest = 0.1;  // half the field [rad]
  constexpr int kScales = 24;  // focal lengths, each 1.12 times the one before
  const double half = 0.5 * (row - 1);
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < kScales; ++k) {
    const double f = half / (kWidest * std::pow(kNarrowest / kWidest, k / (kScales - 1.0)));
    const Eigen::VectorXd straight = u.unaryExpr(
        [&](double value) { return half + f * measure::Straighten(lens, (value - half) / f); });
    DirectGuess guess;
    guess.fit = FitDirectRobust(p, straight, rng);
    guess.camera = CameraFromDirect(guess.fit.fit.transform, centre);
    guess.camera.lens = lens;
    // In the readings' own pixels: straightening stretches those at the edge.
    std::vector<double> residuals;
    for (Eigen::Index i = 0; i < p.cols(); ++i) {
      double predicted = 0.0;
      const bool seen = measure::Project(guess.camera, p.col(i), &predicted);
      residuals.push_back(seen ? u(i) - predicted : row);
    }
    guess.fit.sigma_px = RobustSigma(residuals);
    if (!(guess.fit.sigma_px < least)) continue;
    least = guess.fit.sigma_px;
    best = guess;
  }
  return best;
}

// Where readings fit no camera: whether they do with each written one row off. "before", "after" or
// neither.
std::string ShiftThatFits(const Observations& data, const Observations& own, int row,
                          const GuessOptions& options, int index) {
  for (const int by : {-1, 1}) {
    std::vector<Eigen::Vector3d> places;
    std::vector<double> u;
    for (const Reading& r : own.readings) {
      if (r.point + by < 0 || r.point + by >= data.points()) continue;
      places.emplace_back(data.p.col(r.point + by));
      u.push_back(r.u_px);
    }
    if (static_cast<int>(u.size()) < options.fewest_points) continue;
    Eigen::Matrix3Xd p(3, static_cast<Eigen::Index>(u.size()));
    for (std::size_t k = 0; k < u.size(); ++k) p.col(static_cast<Eigen::Index>(k)) = places[k];
    const Eigen::VectorXd readings =
        Eigen::VectorXd::Map(u.data(), static_cast<Eigen::Index>(u.size()));
    const DirectGuess guess =
        GuessDirect(p, readings, row, options.lens,
                    Rng(options.seed).Stream("one row off", static_cast<std::uint64_t>(index)));
    if (guess.fit.sigma_px < kLargestScale * (Quantile(u, 0.95) - Quantile(u, 0.05))) {
      return by < 0 ? "before" : "after";
    }
  }
  return "";
}

// What one camera sees: surveyed places and readings.
struct CameraPoints {
  Eigen::Matrix3Xd p;
  Eigen::VectorXd u;
};

// The camera alone, the survey taken as exact, from guess->camera; lens error is in the first scale
// and, once the terms are fitted, not in the second.
void Resect(const Observations& own, CameraGuess* guess) {
  const int row = guess->camera.pixels;
  guess->sigma_px = std::max(guess->sigma_px, 1e-9 * row);  // not 0 without noise
  BundleOptions resection;
  resection.fix_points = true;
  for (int pass = 0; pass < 3; ++pass) {
    BundleState state{{guess->camera}, own.p};
    const BundleSummary summary =
        SolveBundle(own, {guess->prior}, EqualWeighting(own, guess->sigma_px), resection, &state);
    guess->camera = state.cameras[0];
    guess->sigma_px = std::max(RobustSigma(summary.residual_px), 1e-12 * row);
  }
}

CameraGuess GuessFromNothing(const Observations& data, const Observations& own,
                             const CameraPoints& seen, int index, const GuessOptions& options,
                             const std::string& where) {
  const std::string& name = data.cameras[static_cast<std::size_t>(index)];
  const Eigen::Matrix3Xd& p = seen.p;
  const Eigen::VectorXd& u = seen.u;
  const auto n = static_cast<int>(u.size());
  RefuseFlat(p, options.flatness, fmt::format("the points that camera \"{}\" sees", name), where);

  const int row = data.RowOf(index);
  const DirectGuess found =
      GuessDirect(p, u, row, options.lens,
                  Rng(options.seed).Stream("direct transform", static_cast<std::uint64_t>(index)));
  const RobustDirectFit& direct = found.fit;
  CameraGuess guess;
  guess.readings = n;
  guess.camera = found.camera;
  guess.camera.name = name;
  guess.camera.pixels = row;
  guess.camera.lens = options.lens;
  const Eigen::RowVectorXd depth = guess.camera.R_CW.row(2) * (p.colwise() - guess.camera.p_WC);
  const std::vector<double> readings(u.data(), u.data() + n);
  const bool in_front = static_cast<double>((depth.array() > 0.0).count()) >= kLeastInFront * n;
  if (direct.fit.condition < kLeastCondition || !in_front ||
      !(direct.sigma_px < kLargestScale * (Quantile(readings, 0.95) - Quantile(readings, 0.05)))) {
    const std::string shifted = ShiftThatFits(data, own, row, options, index);
    throw Error(fmt::format("the readings of camera \"{}\" do not fit any camera at the surveyed "
                            "points (they miss by {:.3g} px){}",
                            name, direct.sigma_px,
                            shifted.empty() ? "" : ", but fit the points in the row " + shifted),
                where,
                shifted.empty()
                    ? "check that readings and points belong together and fill the volume"
                    : "shift the columns of its readings by one row");
  }
  guess.richest = MakePrior(guess.camera, p, own.pitch.empty() ? 0.0 : own.pitch[0], options);
  guess.prior = WithOrder({guess.richest}, kFullOrder)[0];
  guess.camera.e = guess.prior.e_mean;

  guess.sigma_px = direct.sigma_px;
  Resect(own, &guess);
  return guess;
}

// From where the camera was, and from nothing where there are points enough: whichever misses less.
CameraGuess GuessFromBefore(const Observations& data, const Observations& own,
                            const CameraPoints& seen, int index, const GuessOptions& options,
                            const std::string& where) {
  const std::string& name = data.cameras[static_cast<std::size_t>(index)];
  const int row = data.RowOf(index);
  const auto stated = static_cast<std::size_t>(index);
  const bool states = stated < data.pixels.size() && data.pixels[stated] > 0;
  const KnownLens* before = &RequireLens(options.known, name, states ? row : 0, where);
  auto with_lens = [&](data::RigCamera camera) {
    CameraGuess guess;
    guess.readings = static_cast<int>(seen.u.size());
    guess.camera = std::move(camera);
    guess.camera.f_px = before->camera.f_px;
    guess.camera.u0_px = before->camera.u0_px;
    guess.camera.e = before->camera.e;
    guess.camera.terms_px = before->camera.terms_px;
    guess.richest = MakePrior(guess.camera, seen.p, 0.0, options);
    KnowLens(*before, &guess.richest);
    guess.prior = guess.richest;
    guess.sigma_px = row;  // it may have been turned by any angle
    Resect(own, &guess);
    return guess;
  };
  CameraGuess best = with_lens(before->camera);
  GuessOptions alone = options;
  alone.lens = before->camera.lens;
  if (static_cast<int>(seen.u.size()) >= options.fewest_points) {
    try {
      CameraGuess anew = with_lens(GuessFromNothing(data, own, seen, index, alone, where).camera);
      if (anew.sigma_px < best.sigma_px) best = std::move(anew);
    } catch (const Error&) {  // flat, or no camera fits: where it was is all there is to start from
    }
  }
  const std::vector<double> readings(seen.u.data(), seen.u.data() + seen.u.size());
  if (!(best.sigma_px < kLargestScale * (Quantile(readings, 0.95) - Quantile(readings, 0.05)))) {
    throw Error(
        fmt::format("the readings of camera \"{}\" do not fit its lens at the surveyed points "
                    "(they miss by {:.3g} px)",
                    name, best.sigma_px),
        where,
        "check that rig and survey are of the same cameras and in one frame, or calibrate "
        "from nothing, by 12 points or more that fill the volume");
  }
  return best;
}

CameraGuess GuessCamera(const Observations& data, int index, const GuessOptions& options,
                        const std::string& where) {
  const std::string& name = data.cameras[static_cast<std::size_t>(index)];
  const Observations own = SelectCamera(data, index);
  const auto n = static_cast<int>(own.readings.size());
  const int fewest = options.known.empty() ? options.fewest_points : options.fewest_with_lens;
  if (n < fewest) {
    throw Error(fmt::format("camera \"{}\" sees {} of the points", name, n), where,
                fmt::format("survey at least {} that it sees", fewest));
  }
  CameraPoints seen;
  seen.p.resize(3, n);
  seen.u.resize(n);
  for (int k = 0; k < n; ++k) {
    seen.p.col(k) = own.p.col(own.readings[static_cast<std::size_t>(k)].point);
    seen.u(k) = own.readings[static_cast<std::size_t>(k)].u_px;
  }
  if (!options.known.empty()) return GuessFromBefore(data, own, seen, index, options, where);
  return GuessFromNothing(data, own, seen, index, options, where);
}

// Two columns with the very same numbers are one camera, pasted twice: their noise cannot agree.
void RefuseCopies(const Observations& data, int fewest, const std::string& where) {
  const auto c = static_cast<std::size_t>(data.camera_count());
  std::vector<int> common(c * c, 0), same(c * c, 0);
  for (std::size_t first = 0; first < data.readings.size();) {
    std::size_t end = first;
    while (end < data.readings.size() && data.readings[end].point == data.readings[first].point) {
      ++end;
    }
    for (std::size_t a = first; a < end; ++a) {
      for (std::size_t b = a + 1; b < end; ++b) {
        const std::size_t pair = static_cast<std::size_t>(data.readings[a].camera) * c +
                                 static_cast<std::size_t>(data.readings[b].camera);
        ++common[pair];
        same[pair] += data.readings[a].u_px == data.readings[b].u_px ? 1 : 0;
      }
    }
    first = end;
  }
  for (std::size_t pair = 0; pair < common.size(); ++pair) {
    if (common[pair] < fewest || same[pair] < common[pair]) continue;
    throw Error(fmt::format("cameras \"{}\" and \"{}\" have the very same readings",
                            data.cameras[pair / c], data.cameras[pair % c]),
                where, "give each camera its own");
  }
}

}  // namespace

void GuessOptions::Check() const {
  const RefuseOption refuse("GuessOptions");
  if (fewest_points < kDirectTransformPoints) {
    refuse("fewest_points", "is fewer than a pinhole's unknowns", "give 7 or more");
  }
  if (!(flatness > 0.0 && flatness < 1.0)) {
    refuse("flatness", "is not between 0 and 1", "give a share");
  }
  if (!(e_sigma >= 0.0)) refuse("e_sigma", "is negative", "give m, or 0 to derive it");
  if (!(along_sigma_share > 0.0)) refuse("along_sigma_share", "is not above 0", "give a share");
  if (!(term_sigmas > 0.0)) refuse("term_sigmas", "is not above 0", "give a factor, as 1");
}

PointSpread SpreadOf(const Eigen::Matrix3Xd& p) {
  const Eigen::Matrix3Xd centred = p.colwise() - p.rowwise().mean();
  const Eigen::Matrix3d moments =
      centred * centred.transpose() / std::max<double>(1.0, static_cast<double>(p.cols()));
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(moments);
  return {eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().reverse(), eigen.eigenvectors().col(0)};
}

std::vector<CameraGuess> GuessCameras(const Observations& data, const GuessOptions& options,
                                      const std::string& where) {
  const bool known = !options.known.empty();
  const int fewest = known ? options.fewest_with_lens : options.fewest_points;
  if (data.points() < fewest) {
    throw Error(fmt::format("the survey has {} points", data.points()), where,
                fmt::format("survey at least {}", fewest));
  }
  if (known) {
    RefuseLine(data.p, options.flatness, "the survey's points", where);
  } else {
    RefuseFlat(data.p, options.flatness, "the survey's points", where);
  }
  RefuseCopies(data, options.fewest_points, where);
  RefuseStillCameras(data, where);
  std::vector<CameraGuess> out;
  out.reserve(static_cast<std::size_t>(data.camera_count()));
  for (int j = 0; j < data.camera_count(); ++j) {
    out.push_back(GuessCamera(data, j, options, where));
  }
  return out;
}

}  // namespace unfurl::calib
