// Distances of marks on one rigid body against all that readings, floors and the calibration may
// be off by: the calibration's errors are the same at every flash and are eliminated once for all,
// so what they may do to a distance is no sign of a fault.
#include "measure/kept_distances.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "base/dense.h"
#include "base/statistics.h"
#include "measure/camera_model.h"
#include "measure/health.h"

namespace unfurl::measure {

namespace {

constexpr std::size_t kAround = 6;       // flashes of the other mark, over which it is interpolated
constexpr std::size_t kMost = 200;       // samples of a distance
constexpr std::size_t kFewest = 5;       // below which nothing is said of it
constexpr double kGap = 1.6;             // of the usual time between flashes: one is missing
constexpr double kLargestShift = 0.05;   // of a row: no camera is bumped so far and still aimed
constexpr double kFound = 1.2815515655;  // sigmas that nine in ten exceed

// A place of a mark, with what moves it.
struct Place {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();    // [m]
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();  // of the readings alone [m^2]
  Eigen::Matrix3Xd F;                             // of the calibration's directions [m]
  Eigen::Matrix3Xd lever;                         // of each camera's reading [m/px]
};

std::optional<Place> PlaceOf(const HealthEvidence& evidence, const Triangulator& triangulator,
                             std::size_t i) {
  const std::size_t cameras = triangulator.cameras();
  std::array<double, CameraBank::kMaxCameras> u{}, s{};
  for (std::size_t c = 0; c < cameras; ++c) {
    u[c] = evidence.At(i, c).u_px;
    s[c] = evidence.At(i, c).s_px;
  }
  const PointSolution point =
      triangulator.Solve({u.data(), cameras}, {s.data(), cameras}, triangulator.centre());
  if (point.outcome != PointOutcome::kSolved) return {};
  Place out;
  out.p = point.p;
  Eigen::Matrix3d rest = Eigen::Matrix3d::Zero();
  out.F.resize(3, triangulator.shared_rank());
  triangulator.SharedFactor(point, {s.data(), cameras}, out.F, &rest);
  out.cov = point.cov + rest;
  out.lever = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(cameras));
  for (std::size_t c = 0; c < cameras; ++c) {
    Projection seen;
    const data::RigCamera& camera = triangulator.rig().cameras[c];
    if ((point.cameras >> c & 1U) == 0 || !Project(camera, point.p, &seen)) continue;
    const double floor = data::FloorOf(triangulator.rig(), c);
    out.lever.col(static_cast<Eigen::Index>(c)) =
        point.cov * seen.du_dp.transpose() / (s[c] * s[c] + floor * floor);
  }
  return out;
}

// Weights of Lagrange's polynomial through t[from .. from + count) at `at`.
std::array<double, kAround> Lagrange(const std::array<double, kAround>& t, std::size_t from,
                                     std::size_t count, double at) {
  std::array<double, kAround> w{};
  for (std::size_t k = from; k < from + count; ++k) {
    w[k] = 1.0;
    for (std::size_t j = from; j < from + count; ++j) {
      if (j != k) w[k] *= (at - t[j]) / (t[k] - t[j]);
    }
  }
  return w;
}

// A distance at one flash.
struct Sample {
  double d = 0.0, v = 0.0;  // and its variance by the readings [m, m^2]
  Eigen::VectorXd F;        // what the calibration's directions do to it [m]
  Eigen::VectorXd lever;    // what each camera's shift does to it [m/px]
};

class Distances {
 public:
  Distances(const HealthEvidence& evidence, const Triangulator& triangulator,
            std::span<const KeptDistance> distances, std::span<const std::string> marks)
      : evidence_(evidence), triangulator_(triangulator), distances_(distances) {
    for (const KeptDistance& one : distances) samples_.push_back(SamplesOf(one, marks));
  }

  std::size_t samples(std::size_t k) const { return samples_[k].size(); }
  bool Enough() const {
    return std::all_of(samples_.begin(), samples_.end(),
                       [](const auto& one) { return one.size() >= kFewest; });
  }

  // What is true loses none: a delay by rounds of slots would keep those where the marks rest.
  bool LosesPlacesOf(const Distances& as_named) const {
    return !std::equal(samples_.begin(), samples_.end(), as_named.samples_.begin(),
                       [](const auto& a, const auto& b) { return 10 * a.size() >= 9 * b.size(); });
  }

  // The residuals of all, and what explains them without anybody's fault.
  void Solve() {
    const auto cameras = static_cast<Eigen::Index>(triangulator_.cameras());
    const auto pairs = static_cast<Eigen::Index>(distances_.size());
    const Eigen::Index rank = triangulator_.shared_rank();
    Eigen::Index n = 0;
    for (const auto& one : samples_) n += static_cast<Eigen::Index>(one.size());
    r_.resize(n);
    v_.resize(n);
    U_ = Eigen::MatrixXd::Zero(n, rank + cameras + pairs);
    G_.resize(n, cameras);
    ones_ = Eigen::MatrixXd::Zero(n, pairs);
    Eigen::Index row = 0;
    for (Eigen::Index k = 0; k < pairs; ++k) {
      const KeptDistance& one = distances_[static_cast<std::size_t>(k)];
      const std::vector<Sample>& own = samples_[static_cast<std::size_t>(k)];
      // Of a length that nobody states anything may be true.
      const double from = one.length > 0.0 ? one.length : own.front().d;
      const double sigma = one.length > 0.0 ? one.sigma : triangulator_.size();
      for (const Sample& sample : own) {
        r_(row) = sample.d - from;
        v_(row) = sample.v;
        U_.row(row).head(rank) = sample.F;
        for (Eigen::Index c = 0; c < cameras; ++c) {
          G_(row, c) = sample.lever(c);
          // The model's own error may be the same wherever marks go.
          U_(row, rank + c) =
              data::FloorOf(triangulator_.rig(), static_cast<std::size_t>(c)) * sample.lever(c);
        }
        U_(row, rank + cameras + k) = sigma;
        ones_(row, k) = 1.0;
        ++row;
      }
    }
    VU_ = v_.cwiseInverse().asDiagonal() * U_;
    solver_.compute(Eigen::MatrixXd::Identity(U_.cols(), U_.cols()) + U_.transpose() * VU_);
    Ur_ = VU_.transpose() * r_;
    solved_ = solver_.solve(Ur_);
    squares_ = r_.dot(r_.cwiseQuotient(v_)) - Ur_.dot(solved_);
  }

  // Squared residuals over their variances, and how many numbers are in them.
  double squares() const { return squares_; }
  double degrees() const {
    const auto free = std::count_if(distances_.begin(), distances_.end(),
                                    [](const KeptDistance& one) { return !(one.length > 0.0); });
    return static_cast<double>(r_.size() - free);
  }
  // By how much of a column there is, and its standard deviation.
  struct Amount {
    double value = 0.0, sigma = HUGE_VAL;
    double z() const { return value / sigma; }
  };
  Amount ShiftOf(std::size_t camera) const {
    return AmountOf(G_.col(static_cast<Eigen::Index>(camera)));
  }
  Amount LongerBy(std::size_t pair) const {
    return AmountOf(ones_.col(static_cast<Eigen::Index>(pair)));
  }

  DistanceReport::One Found(std::size_t k) const {
    DistanceReport::One out;
    const auto& own = samples_[k];
    out.samples = own.size();
    double weights = 0.0, sum = 0.0;
    Eigen::VectorXd F = Eigen::VectorXd::Zero(triangulator_.shared_rank());
    for (const Sample& sample : own) {
      weights += 1.0 / sample.v;
      sum += sample.d / sample.v;
      F += sample.F / sample.v;
    }
    out.length = sum / weights;
    F /= weights;
    out.sigma = std::sqrt(1.0 / weights + F.squaredNorm());
    for (const Sample& sample : own) {
      out.scatter += (sample.d - out.length) * (sample.d - out.length);
      out.expected += sample.v + (sample.F - F).squaredNorm();
    }
    const auto n = static_cast<double>(own.size());
    out.scatter = std::sqrt(out.scatter / n);
    out.expected = std::sqrt(out.expected / n);
    return out;
  }

 private:
  Amount AmountOf(const Eigen::VectorXd& g) const {
    const Eigen::VectorXd Vg = g.cwiseQuotient(v_), Ug = U_.transpose() * Vg;
    const double information = g.dot(Vg) - Ug.dot(solver_.solve(Ug));
    if (!(information > 0.0)) return {};
    return {(Vg.dot(r_) - Ug.dot(solved_)) / information, 1.0 / std::sqrt(information)};
  }

  std::vector<std::size_t> FlashesOf(const std::string& mark,
                                     std::span<const std::string> marks) const {
    const auto at = std::find(marks.begin(), marks.end(), mark);
    std::vector<std::size_t> out;
    if (at == marks.end()) return out;
    for (std::size_t i = 0; i < evidence_.size(); ++i) {
      if (evidence_.mark(i) == static_cast<int>(at - marks.begin())) out.push_back(i);
    }
    return out;
  }

  std::vector<Sample> SamplesOf(const KeptDistance& one, std::span<const std::string> marks) const {
    const std::vector<std::size_t> a = FlashesOf(one.a, marks), b = FlashesOf(one.b, marks);
    std::vector<Sample> out;
    if (a.empty() || b.size() < kAround) return out;
    std::vector<double> t, steps;
    for (const std::size_t i : b) t.push_back(evidence_.t(i));
    for (std::size_t k = 1; k < t.size(); ++k) steps.push_back(t[k] - t[k - 1]);
    const double longest = kGap * Median(steps) * (kAround - 1);
    // No flash is in two samples, so that their noise is not.
    const std::size_t stride = std::max(kAround, a.size() / kMost);
    std::size_t next = 0;
    for (std::size_t k = 0; k < a.size(); ++k) {
      if (k < next) continue;
      const double at = evidence_.t(a[k]);
      const auto after =
          static_cast<std::size_t>(std::lower_bound(t.begin(), t.end(), at) - t.begin());
      if (after < kAround / 2 || after + kAround / 2 > t.size()) continue;
      const std::size_t first = after - kAround / 2;
      if (t[first + kAround - 1] - t[first] > longest) continue;
      if (auto sample = SampleOf(a[k], std::span(b).subspan(first, kAround))) {
        out.push_back(std::move(*sample));
        next = k + stride;
      }
    }
    return out;
  }

  std::optional<Sample> SampleOf(std::size_t a, std::span<const std::size_t> b) const {
    const std::optional<Place> here = PlaceOf(evidence_, triangulator_, a);
    if (!here) return {};
    std::array<double, kAround> t{};
    for (std::size_t k = 0; k < kAround; ++k) t[k] = evidence_.t(b[k]);
    const std::array<double, kAround> few = Lagrange(t, 1, kAround - 2, evidence_.t(a));
    const std::array<double, kAround> many = Lagrange(t, 0, kAround, evidence_.t(a));
    Place there;
    there.F = Eigen::Matrix3Xd::Zero(3, here->F.cols());
    there.lever = Eigen::Matrix3Xd::Zero(3, here->lever.cols());
    Eigen::Vector3d off = Eigen::Vector3d::Zero();  // the polynomial's error, as the next one shows
    for (std::size_t k = 0; k < kAround; ++k) {
      const std::optional<Place> one = PlaceOf(evidence_, triangulator_, b[k]);
      if (!one) return {};
      there.p += few[k] * one->p;
      there.cov += few[k] * few[k] * one->cov;
      there.F += few[k] * one->F;
      there.lever += few[k] * one->lever;
      off += (many[k] - few[k]) * one->p;
    }
    const Eigen::Vector3d way = here->p - there.p;
    Sample out;
    out.d = way.norm();
    if (!(out.d > 0.0)) return {};
    const Eigen::Vector3d u = way / out.d;
    const double missed = u.dot(off);
    out.v = u.dot((here->cov + there.cov) * u) + missed * missed;
    out.F = (here->F - there.F).transpose() * u;
    out.lever = (here->lever - there.lever).transpose() * u;
    return out;
  }

  const HealthEvidence& evidence_;
  const Triangulator& triangulator_;
  std::span<const KeptDistance> distances_;
  std::vector<std::vector<Sample>> samples_;  // by distance
  Eigen::VectorXd r_, v_, Ur_, solved_;
  Eigen::MatrixXd U_, VU_, G_, ones_;
  Eigen::LLT<Eigen::MatrixXd> solver_;
  double squares_ = 0.0;
};

// The level of each of the tests: of all together, of every camera and of every distance.
double LevelOf(const Triangulator& triangulator, std::size_t distances,
               const HealthOptions& options) {
  return ChanceOfEach(options.false_alarm,
                      static_cast<double>(1 + triangulator.cameras() + distances));
}

bool Kept(const Distances& all, const Triangulator& triangulator, std::size_t distances,
          double level) {
  if (ChiSquareTail(all.squares(), all.degrees()) < level) return false;
  const double limit = NormalQuantile(1.0 - 0.5 * level);
  for (std::size_t c = 0; c < triangulator.cameras(); ++c) {
    if (std::abs(all.ShiftOf(c).z()) > limit) return false;
  }
  for (std::size_t k = 0; k < distances; ++k) {
    if (std::abs(all.LongerBy(k).z()) > limit) return false;
  }
  return true;
}

// What of one camera, or of two exchanged, would keep the distances.
class Causes {
 public:
  Causes(const HealthEvidence& evidence, const Triangulator& triangulator,
         std::span<const KeptDistance> distances, std::span<const std::string> marks,
         const HealthOptions& options)
      : evidence_(evidence),
        triangulator_(triangulator),
        distances_(distances),
        marks_(marks),
        options_(options),
        level_(LevelOf(triangulator, distances.size(), options)) {}

  std::vector<DistanceReport::Cause> Find(const Distances& as_named) {
    std::vector<DistanceReport::Cause> out;
    const auto cameras = static_cast<int>(triangulator_.cameras());
    as_named_ = &as_named;
    for (int c = 0; c < cameras && as_named.Enough(); ++c) Shifted(as_named, c, &out);
    for (int c = 0; c < cameras; ++c) {
      for (int lag = -options_.most_lag; lag <= options_.most_lag; ++lag) {
        if (lag == 0) continue;
        HealthEvidence taken = evidence_;
        taken.Correct({.camera = c, .lag = lag});
        if (Keeps(taken)) out.push_back({.cameras = {c}, .lag = lag});
      }
      for (int other = c + 1; other < cameras; ++other) {
        HealthEvidence taken = evidence_;
        taken.Exchange(static_cast<std::size_t>(c), static_cast<std::size_t>(other));
        if (Keeps(taken)) out.push_back({.cameras = {c, other}});
      }
    }
    return out;
  }

 private:
  void Shifted(const Distances& as_named, int c, std::vector<DistanceReport::Cause>* out) const {
    const Distances::Amount shift = as_named.ShiftOf(static_cast<std::size_t>(c));
    const double row = triangulator_.rig().cameras[static_cast<std::size_t>(c)].pixels;
    if (!(std::abs(shift.value) < kLargestShift * row)) return;
    // Far from where it was a shift is no longer in proportion: it is taken out, and looked again.
    HealthEvidence taken = evidence_;
    taken.Correct({.camera = c, .offset_px = shift.value});
    Distances left(taken, triangulator_, distances_, marks_);
    if (!left.Enough()) return;
    left.Solve();
    const double more = left.ShiftOf(static_cast<std::size_t>(c)).value;
    taken.Correct({.camera = c, .offset_px = more});
    if (!Keeps(taken)) return;
    out->push_back({.cameras = {c}, .px = shift.value + more, .sigma_px = shift.sigma});
  }

  bool Keeps(const HealthEvidence& evidence) const {
    Distances all(evidence, triangulator_, distances_, marks_);
    if (!all.Enough() || all.LosesPlacesOf(*as_named_)) return false;
    all.Solve();
    return Kept(all, triangulator_, distances_.size(), level_);
  }

  const HealthEvidence& evidence_;
  const Triangulator& triangulator_;
  std::span<const KeptDistance> distances_;
  std::span<const std::string> marks_;
  const HealthOptions& options_;
  double level_;
  const Distances* as_named_ = nullptr;
};

}  // namespace

DistanceReport JudgeDistances(const HealthEvidence& evidence, const Triangulator& triangulator,
                              std::span<const KeptDistance> distances,
                              std::span<const std::string> marks, const HealthOptions& options) {
  DistanceReport out;
  if (distances.empty()) return out;
  Distances all(evidence, triangulator, distances, marks);
  for (std::size_t k = 0; k < distances.size(); ++k) {
    out.each.push_back(all.samples(k) > 0 ? all.Found(k) : DistanceReport::One{});
    if (all.samples(k) >= kFewest || !out.unknown.empty()) continue;
    out.unknown = fmt::format(
        "of {} and {} {} places were found at one time, and {} are needed: each must be lit by "
        "itself and found in {} of its flashes in a row",
        distances[k].a, distances[k].b, all.samples(k), kFewest, kAround);
  }
  if (!out.unknown.empty()) {
    // Marks that are not found where their cameras are named wrongly may be found where they are
    // not.
    out.causes = Causes(evidence, triangulator, distances, marks, options).Find(all);
    out.kept = out.causes.empty();
    if (!out.kept) out.unknown.clear();
    return out;
  }
  all.Solve();
  const double level = LevelOf(triangulator, distances.size(), options);
  const double limit = NormalQuantile(1.0 - 0.5 * level);
  for (std::size_t c = 0; c < triangulator.cameras(); ++c) {
    out.shows_px.push_back((limit + kFound) * all.ShiftOf(c).sigma);
  }
  out.kept = Kept(all, triangulator, distances.size(), level);
  if (!out.kept) {
    out.causes = Causes(evidence, triangulator, distances, marks, options).Find(all);
  }
  return out;
}

}  // namespace unfurl::measure
