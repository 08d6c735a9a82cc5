#include "calib/wand_guess.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>

#include "base/dense.h"
#include "base/error.h"
#include "base/progress.h"
#include "base/refuse_option.h"
#include "base/statistics.h"
#include "base/text.h"
#include "calib/wand_triple.h"
#include "measure/triangulate.h"

namespace unfurl::calib {
namespace {

constexpr double kNominal = 0.03;  // of the row: a camera that stands about where it was meant to
// Planes that meet at a small angle give poor marks, which is the bundle's affair: it has the bars.
constexpr double kAnyCondition = 1e4;
constexpr int kMoreStarts = 4;  // times as many in each round, so that all rounds cost as the last
// Of marks from cameras and cameras from marks, once all cameras are in.
constexpr int kWholeRounds = 2;

// Readings less the row's middle, over the row: c x (n m); NaN: not seen.
Eigen::MatrixXd Normalised(const WandData& data, const Observations& marks) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Constant(data.camera_count(), marks.points(), kUnknown);
  for (const Reading& r : marks.readings) {
    const double row = marks.RowOf(r.camera);
    out(r.camera, r.point) = (r.u_px - 0.5 * (row - 1.0)) / row;
  }
  return out;
}

// Three cameras, and the poses whose two ends all three see.
struct Triple {
  Eigen::Vector3i camera = Eigen::Vector3i::Zero();
  std::vector<int> poses;
  double worth = 0.0;  // poses, times how far the three rows are from parallel to one plane
};

// The marks at the two ends of the bar.
std::pair<int, int> EndsOf(const WandData& data) {
  Eigen::Index low = 0, high = 0;
  data.place.minCoeff(&low);
  data.place.maxCoeff(&high);
  return {static_cast<int>(low), static_cast<int>(high)};
}

Eigen::Matrix3Xd EndReadings(const WandData& data, const Eigen::MatrixXd& u, const Triple& triple,
                             int end) {
  Eigen::Matrix3Xd out(3, static_cast<Eigen::Index>(triple.poses.size()));
  for (std::size_t k = 0; k < triple.poses.size(); ++k) {
    for (int j = 0; j < 3; ++j) {
      out(j, static_cast<Eigen::Index>(k)) =
          u(triple.camera(j), triple.poses[k] * data.mark_count() + end);
    }
  }
  return out;
}

Triple TripleOf(const WandData& data, const Eigen::MatrixXd& u, const Eigen::Vector3i& camera) {
  const auto [low, high] = EndsOf(data);
  Triple out{camera, {}, 0.0};
  for (int k = 0; k < data.pose_count(); ++k) {
    bool whole = true;
    for (int j = 0; j < 3; ++j) {
      whole = whole && std::isfinite(u(camera(j), k * data.mark_count() + low)) &&
              std::isfinite(u(camera(j), k * data.mark_count() + high));
    }
    if (whole) out.poses.push_back(k);
  }
  if (out.poses.empty()) return out;
  const Eigen::Matrix3Xd d = EndReadings(data, u, out, high) - EndReadings(data, u, out, low);
  Eigen::Matrix3d moments = d * d.transpose();
  const Eigen::Vector3d scale = moments.diagonal().cwiseSqrt().cwiseInverse();
  moments = scale.asDiagonal() * moments * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(moments);
  out.worth =
      static_cast<double>(out.poses.size()) * std::sqrt(std::max(eigen.eigenvalues()(0), 0.0));
  return out;
}

std::vector<Triple> RankTriples(const WandData& data, const Eigen::MatrixXd& u, int fewest) {
  std::vector<Triple> out;
  const int c = data.camera_count();
  for (int i = 0; i < c; ++i) {
    for (int j = i + 1; j < c; ++j) {
      for (int k = j + 1; k < c; ++k) {
        Triple triple = TripleOf(data, u, {i, j, k});
        if (static_cast<int>(triple.poses.size()) >= fewest) out.push_back(std::move(triple));
      }
    }
  }
  std::stable_sort(out.begin(), out.end(),
                   [](const Triple& a, const Triple& b) { return a.worth > b.worth; });
  return out;
}

// The cameras of a mask and the points at known places that they read; `number` of each camera.
Observations Known(const Observations& marks, const Eigen::Matrix3Xd& p,
                   const std::vector<char>& camera, std::vector<int>* number) {
  std::vector<int> keep;
  for (Eigen::Index i = 0; i < p.cols(); ++i) {
    if (p.col(i).allFinite()) keep.push_back(static_cast<int>(i));
  }
  Observations all = marks;
  all.p = p;
  Observations out = SelectPoints(all, keep);
  std::vector<int> renumbered(camera.size(), -1);
  out.cameras.clear();
  out.pixels.clear();
  out.pitch.clear();
  number->clear();
  for (std::size_t j = 0; j < camera.size(); ++j) {
    if (camera[j] == 0) continue;
    renumbered[j] = static_cast<int>(number->size());
    number->push_back(static_cast<int>(j));
    out.cameras.push_back(marks.cameras[j]);
    out.pixels.push_back(marks.RowOf(static_cast<int>(j)));
    if (j < marks.pitch.size()) out.pitch.push_back(marks.pitch[j]);
  }
  std::vector<Reading> readings;
  for (Reading r : out.readings) {
    r.camera = renumbered[static_cast<std::size_t>(r.camera)];
    if (r.camera >= 0) readings.push_back(r);
  }
  out.readings = std::move(readings);
  return out;
}

// Which cameras read enough of the points at known places.
std::vector<char> Seeing(const Observations& marks, const Eigen::Matrix3Xd& p, int fewest) {
  std::vector<int> count(marks.cameras.size(), 0);
  for (const Reading& r : marks.readings) {
    if (p.col(r.point).allFinite()) ++count[static_cast<std::size_t>(r.camera)];
  }
  std::vector<char> out;
  out.reserve(count.size());
  for (const int n : count) out.push_back(n >= fewest ? 1 : 0);
  return out;
}

}  // namespace

Eigen::Matrix3Xd LocateMarks(const Observations& marks, const std::vector<data::RigCamera>& cameras,
                             const std::vector<int>& number, const std::vector<double>& sigma_px,
                             const Eigen::Matrix3Xd& near, std::vector<RoughMark>* rough) {
  // The box by quantiles: a gross error may have put a mark anywhere.
  data::Rig rig;
  rig.cameras = cameras;
  for (std::size_t j = 0; j < cameras.size(); ++j) rig.cameras[j].floor_px = sigma_px[j];
  constexpr double kTail = 0.02;  // of the places, on either side
  for (int k = 0; k < 3; ++k) {
    std::vector<double> values;
    for (Eigen::Index i = 0; i < near.cols(); ++i) {
      if (near.col(i).allFinite()) values.push_back(near(k, i));
    }
    rig.volume_low(k) = Quantile(values, kTail);
    rig.volume_high(k) = Quantile(values, 1.0 - kTail);
  }
  const measure::Triangulator triangulator(rig, {.max_condition = kAnyCondition});
  Eigen::Matrix3Xd out = Eigen::Matrix3Xd::Constant(3, marks.points(), kUnknown);
  std::vector<int> of(marks.cameras.size(), -1);
  for (std::size_t j = 0; j < number.size(); ++j) {
    of[static_cast<std::size_t>(number[j])] = static_cast<int>(j);
  }
  std::vector<double> u(cameras.size()), s(cameras.size(), 0.0);
  std::size_t k = 0;
  for (int i = 0; i < marks.points(); ++i) {
    std::fill(u.begin(), u.end(), kUnknown);
    for (; k < marks.readings.size() && marks.readings[k].point == i; ++k) {
      const Reading& r = marks.readings[k];
      const int j = of[static_cast<std::size_t>(r.camera)];
      if (j < 0) continue;
      u[static_cast<std::size_t>(j)] = r.u_px;
      s[static_cast<std::size_t>(j)] = r.s_px;
    }
    const measure::PointSolution found = triangulator.Solve(u, s, triangulator.centre());
    if (found.outcome == measure::PointOutcome::kSolved) out.col(i) = found.p;
    if (rough == nullptr || found.outcome != measure::PointOutcome::kDisagree) continue;
    rough->push_back({i, found.p});
    for (std::size_t j = 0; j < u.size(); ++j) {
      if (std::isnan(u[j])) continue;
      const measure::PointSolution rest = triangulator.Solve(u, s, found.p, ~(1U << j));
      if (rest.outcome == measure::PointOutcome::kSolved) rough->push_back({i, rest.p});
    }
  }
  return out;
}

namespace {

// A plane of marks tells no camera from its mirror image in that plane, nor its distance from its
// image scale.
void RefusePlane(const Eigen::Matrix3Xd& p, double flatness, const std::string& where) {
  const PointSpread spread = SpreadOf(p);
  if (!(spread.sigma(2) < flatness * spread.sigma(0))) return;
  throw Error(fmt::format("the bar's marks lie in one plane ({:.0f}% as thick as it is wide)",
                          100.0 * spread.sigma(2) / spread.sigma(0)),
              where, "move the bar off that plane, and turn it out of it");
}

// From marks at some places to all cameras: those that see enough of them, the marks that these
// find, and again.
WandGuess Grow(const Observations& marks, Eigen::Matrix3Xd p, const GuessOptions& options,
               const std::string& where) {
  const std::size_t c = marks.cameras.size();
  WandGuess out;
  std::size_t known = 0;
  for (int whole = 0; whole < kWholeRounds;) {
    const std::vector<char> in = Seeing(marks, p, options.fewest_points);
    std::vector<int> number;
    const Observations own = Known(marks, p, in, &number);
    if (number.size() < 3 || (number.size() < c && number.size() <= known)) {
      std::vector<std::string> lost;
      for (std::size_t j = 0; j < c; ++j) {
        if (in[j] == 0) lost.push_back("\"" + marks.cameras[j] + "\"");
      }
      throw Error(fmt::format("camera {} sees fewer than {} of the marks that three others find",
                              JoinWords(lost), options.fewest_points),
                  where, "move the bar through what each camera shares with two others");
    }
    known = number.size();
    RefusePlane(own.p, options.flatness, where);
    try {
      out.cameras = GuessCameras(own, options, where);
    } catch (const Error&) {  // its words are of surveyed points
      throw Error("the marks that three of them find fit no cameras", where, "");
    }
    std::vector<data::RigCamera> cameras;
    std::vector<double> sigma, shares;
    for (const CameraGuess& guess : out.cameras) {
      cameras.push_back(guess.camera);
      sigma.push_back(guess.sigma_px);
      shares.push_back(guess.sigma_px / guess.camera.pixels);
    }
    out.misfit = Median(shares);
    const Eigen::Matrix3Xd found = LocateMarks(marks, cameras, number, sigma, p);
    for (Eigen::Index i = 0; i < p.cols(); ++i) {
      if (found.col(i).allFinite()) p.col(i) = found.col(i);
    }
    if (known == c) ++whole;
  }
  out.marks = p;
  return out;
}

}  // namespace

void WandGuessOptions::Check() const {
  const RefuseOption refuse("WandGuessOptions");
  if (fewest_poses < 6) refuse("fewest_poses", "is below 6", "give 6 or more");
  if (starts < 0) refuse("starts", "is negative", "give 0 or more");
  if (rounds < 1) refuse("rounds", "is below 1", "give some");
  if (ends < 1) refuse("ends", "is below 1", "give some");
  if (triples < 1) refuse("triples", "is below 1", "give some");
}

namespace {

// Of the search from nothing: what all three cameras share.
struct GuessTask {
  const WandData& data;
  const GuessOptions& cameras;
  const WandGuessOptions& options;
  const std::string& where;
  const std::function<bool(const WandGuess&)>& enough;
  Observations marks;
  Eigen::MatrixXd u;
  bool any = false;  // of the guesses led to cameras
  std::string last = "no search of three cameras ended at a bar of one length";

  // Marks from three pinholes, all cameras from the marks, and what the caller makes of them.
  bool Follow(const Triple& few, const TriplePinholes& pinholes) {
    Eigen::Matrix3Xd p = Eigen::Matrix3Xd::Constant(3, marks.points(), kUnknown);
    for (int i = 0; i < marks.points(); ++i) {
      Eigen::Vector3d at;
      const Eigen::Vector3d reading = u.col(i)(few.camera);
      if (reading.allFinite() && pinholes.Find(reading, &at)) p.col(i) = data.Length() * at;
    }
    try {
      const WandGuess guess = Grow(marks, p, cameras, where);
      any = true;
      return enough(guess);
    } catch (const Error& error) {
      last = error.problem();
      return false;
    }
  }
};

}  // namespace

void GuessWand(const WandData& data, const GuessOptions& cameras, const WandGuessOptions& options,
               const std::string& where, const std::function<bool(const WandGuess&)>& enough) {
  GuessTask task{data, cameras, options, where, enough, AsPoints(data, data.Length()), {}};
  task.u = Normalised(data, task.marks);
  const std::vector<Triple> triples = RankTriples(data, task.u, options.fewest_poses);
  if (triples.empty()) {
    throw Error(fmt::format("no three cameras see both ends of the bar in {} poses or more",
                            options.fewest_poses),
                where, "move the bar through what three cameras see, in more poses");
  }
  const auto [low, high] = EndsOf(data);
  const Rng rng = Rng(cameras.seed).Stream("wand");
  std::vector<std::vector<TriplePinholes>> tried(
      std::min(triples.size(), static_cast<std::size_t>(options.triples)));
  // Few starts of every three cameras are tried before more of any.
  int starts = options.starts;
  for (int round = 0; round < options.rounds; ++round, starts *= kMoreStarts) {
    for (std::size_t k = 0; k < tried.size(); ++k) {
      const Triple& few = triples[k];
      const BarReadings bars{EndReadings(data, task.u, few, low),
                             EndReadings(data, task.u, few, high)};
      const std::vector<TriplePinholes> fresh = FitTriple(
          bars, starts, options.ends, tried[k],
          rng.Stream("round", static_cast<std::uint64_t>(round)).Stream("three cameras", k));
      bool done = false;  // all ends of three cameras are followed: another may be as good
      for (const TriplePinholes& pinholes : fresh) {
        ThrowIfInterrupted();
        done = task.Follow(few, pinholes) || done;
        tried[k].push_back(pinholes);
      }
      if (done) return;
    }
  }
  if (task.any) return;
  throw Error("no start leads to cameras that fit the bar: " + task.last, where,
              "check that readings and --bar belong together, wave the bar through more places and "
              "directions, or give an earlier rig (--from)");
}

WandGuess GuessWandFrom(const WandData& data, const std::vector<data::RigCamera>& start,
                        const GuessOptions& cameras, const std::string& where) {
  const Observations marks = AsPoints(data, data.Length());
  std::vector<int> number(start.size());
  std::iota(number.begin(), number.end(), 0);
  std::vector<double> sigma;
  Eigen::Matrix3d across = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const data::RigCamera& camera : start) {
    sigma.push_back(kNominal * camera.pixels);
    const Eigen::Vector3d axis = camera.R_CW.row(2);
    const Eigen::Matrix3d off = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    across += off;
    sum += off * camera.p_WC;
  }
  // Where the optical axes meet, and as far around it as half of the way to a camera.
  const Eigen::Vector3d middle = across.ldlt().solve(sum);
  double reach = 0.0;
  for (const data::RigCamera& camera : start) {
    reach = std::max(reach, 0.5 * (camera.p_WC - middle).norm());
  }
  Eigen::Matrix3Xd box(3, 2);
  box.col(0) = middle.array() - reach;
  box.col(1) = middle.array() + reach;
  return Grow(marks, LocateMarks(marks, start, number, sigma, box), cameras, where);
}

}  // namespace unfurl::calib
