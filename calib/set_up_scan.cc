#include "calib/set_up_scan.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "base/dense.h"
#include "base/length.h"
#include "base/statistics.h"
#include "calib/score_test.h"

namespace unfurl::calib {
namespace {

constexpr Eigen::Index kRigidSix = 6;  // unknowns of one
// Where parts begin, about, as shares of the points: smaller ones have too few to be told [-].
constexpr double kPartFrom[] = {0.2, 0.35, 0.5, 0.65, 0.8};
// Directions of planes are those of a lattice of so many points a side about its middle, 49 pairs
// of opposite ones: none is further than some 18 degrees from one of them.
constexpr int kLattice = 5;
constexpr int kFewestScanned = 30;  // points; with less a part has too few [-]
// Of points so near the bound of a part, in their sigmas, noise decides on which side they are: on
// a wall that a cut is along it would part those that came out too high from those too low, which
// are off from each other. A hundredth of all of them moves a part's mean by less than its own
// sigma.
constexpr double kNearBound = 3.0, kFewNear = 0.01;  // [-]
// Share of an unknown's information that must be left after the fit (as in trends.cc) [-].
constexpr double kScanLeft = 1e-3;

// Points in the order of one key; a part is those above a quantile of it.
struct SurveyCut {
  std::string name;         // of the part, with the bound to come
  std::vector<double> key;  // of each point
  double sigma = 0.0;       // of a key
};

// The bounds of a cut's parts: near each share of the points, where few of them are near.
std::vector<double> BoundsOf(const SurveyCut& cut) {
  std::vector<double> key = cut.key;
  std::sort(key.begin(), key.end());
  const auto n = static_cast<std::ptrdiff_t>(key.size());
  const auto few = static_cast<std::ptrdiff_t>(kFewNear * static_cast<double>(n));
  std::vector<std::ptrdiff_t> near;  // points about the middle between one and the next
  for (std::ptrdiff_t k = 0; k + 1 < n; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const double bound = 0.5 * (key[at] + key[at + 1]), reach = kNearBound * cut.sigma;
    near.push_back(std::upper_bound(key.begin(), key.end(), bound + reach) -
                   std::lower_bound(key.begin(), key.end(), bound - reach));
  }
  std::vector<double> out;
  for (const double share : kPartFrom) {
    const double wish = share * static_cast<double>(n - 1);
    std::size_t best = 0;
    const auto price = [&](std::size_t k) {
      return std::pair(std::max(near[k], few), std::abs(static_cast<double>(k) + 0.5 - wish));
    };
    for (std::size_t k = 1; k < near.size(); ++k) {
      if (price(k) < price(best)) best = k;
    }
    const double bound = 0.5 * (key[best] + key[best + 1]);
    if (std::find(out.begin(), out.end(), bound) == out.end()) out.push_back(bound);
  }
  return out;
}

std::vector<SurveyCut> CutsOf(const Observations& data, const Eigen::Vector3d& middle) {
  std::vector<double> sigmas;
  for (const Eigen::Matrix3d& cov : data.cov) sigmas.push_back(std::sqrt(cov.trace() / 3.0));
  const double sigma = Median(sigmas);
  std::vector<SurveyCut> out;
  for (int k = kLattice * kLattice * kLattice / 2 + 1; k < kLattice * kLattice * kLattice; ++k) {
    const Eigen::Vector3i way =
        Eigen::Vector3i(k / (kLattice * kLattice), k / kLattice % kLattice, k % kLattice).array() -
        kLattice / 2;
    if (std::gcd(std::gcd(way.x(), way.y()), way.z()) > 1) continue;  // the half of another
    SurveyCut cut;
    cut.sigma = sigma * way.cast<double>().norm();
    for (int a = 0; a < 3; ++a) {
      if (way(a) == 0) continue;
      cut.name +=
          fmt::format("{}{}{}", way(a) > 0 ? '+' : '-',
                      std::abs(way(a)) > 1 ? std::to_string(std::abs(way(a))) : "", "xyz"[a]);
    }
    for (Eigen::Index i = 0; i < data.p.cols(); ++i) {
      cut.key.push_back((data.p.col(i) - middle).dot(way.cast<double>()));
    }
    out.push_back(std::move(cut));
  }
  SurveyCut order;
  for (int i = 0; i < data.points(); ++i) order.key.push_back(i);
  out.push_back(std::move(order));
  return out;
}

// Six columns for each part of a cut: shifts [m], and turns by what moves points at `arm` as far.
Columns ColumnsOf(const Observations& data, const SurveyCut& cut, const std::vector<double>& bounds,
                  const Eigen::Vector3d& middle, double arm) {
  Columns out;
  const auto parts = static_cast<Eigen::Index>(bounds.size());
  out.on_survey.setZero(3 * kRigidSix * parts, data.points());
  for (Eigen::Index part = 0; part < parts; ++part) {
    const double from = bounds[static_cast<std::size_t>(part)];
    for (Eigen::Index i = 0; i < data.p.cols(); ++i) {
      if (!(cut.key[static_cast<std::size_t>(i)] > from)) continue;
      const Eigen::Vector3d r = (data.p.col(i) - middle) / arm;
      for (Eigen::Index k = 0; k < kRigidSix; ++k) {
        const Eigen::Vector3d axis = Eigen::Vector3d::Unit(k % 3);
        out.on_survey.block<3, 1>(3 * (kRigidSix * part + k), i) =
            k < 3 ? axis : Eigen::Vector3d(axis.cross(r));
      }
    }
  }
  return out;
}

// The least probable part so far.
struct SurveyPart {
  double chance = 1.0;  // of its own [-]
  std::string name;
  int points = 0;
  Eigen::MatrixXd columns;     // 18 x points [-]
  Eigen::VectorXd motion;      // estimate, [m] at the arm
  Eigen::MatrixXd covariance;  // of it [m^2]
  Eigen::MatrixXd on_cameras;  // of a unit of each
};

// Score, estimate and chance of one part's six.
SurveyPart TestPart(const ScoreTest::Score& score, Eigen::Index part) {
  const Eigen::Index at = kRigidSix * part;
  const Eigen::MatrixXd M = score.covariance.block(at, at, kRigidSix, kRigidSix);
  // In units of what each column told were nothing else unknown.
  const Eigen::VectorXd unit =
      score.whole.diagonal().segment(at, kRigidSix).cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(unit.asDiagonal() * M *
                                                             unit.asDiagonal());
  Eigen::VectorXd inverse = Eigen::VectorXd::Zero(kRigidSix);
  double freedom = 0.0;
  for (Eigen::Index k = 0; k < kRigidSix; ++k) {
    if (!(eigen.eigenvalues()(k) > kScanLeft)) continue;
    inverse(k) = 1.0 / eigen.eigenvalues()(k);
    freedom += 1.0;
  }
  SurveyPart out;
  const Eigen::MatrixXd half = unit.asDiagonal() * eigen.eigenvectors();
  out.covariance = half * inverse.asDiagonal() * half.transpose();
  const Eigen::VectorXd value = score.value.segment(at, kRigidSix);
  out.motion = out.covariance * value;
  if (freedom > 0.0) out.chance = ChiSquareTail(value.dot(out.motion), freedom);
  out.on_cameras = score.on_cameras.middleCols(at, kRigidSix);
  return out;
}

std::string NameOf(const Observations& data, const SurveyCut& cut, double from) {
  if (!cut.name.empty()) return "towards " + cut.name;
  const auto first = static_cast<std::size_t>(std::floor(from)) + 1;
  return fmt::format("from \"{}\" on, in the order of the file",
                     data.ids[std::min(first, data.ids.size() - 1)]);
}

// RMS displacement of the part's points.
double RmsOf(const SurveyPart& part) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < part.columns.cols(); ++i) {
    sum += (part.columns.col(i).reshaped(3, kRigidSix) * part.motion).squaredNorm();
  }
  return std::sqrt(sum / std::max(1, part.points));
}

}  // namespace

Trend ScanSetUps(const Observations& data, const std::vector<CameraPrior>& priors,
                 const RefinedBundle& bundle, const TrendOptions& options) {
  Trend out;
  out.kind = TrendKind::kSurveyShape;
  if (!data.set_ups.empty() || data.points() < kFewestScanned) return out;
  const ScoreTest test(data, priors, bundle);
  const Eigen::Vector3d middle = data.p.rowwise().mean();
  const double arm =
      std::sqrt((data.p.colwise() - middle).squaredNorm() / static_cast<double>(data.points()));
  SurveyPart least;
  double looked = 0.0;
  for (const SurveyCut& cut : CutsOf(data, middle)) {
    const std::vector<double> bounds = BoundsOf(cut);
    const Columns columns = ColumnsOf(data, cut, bounds, middle, arm);
    const ScoreTest::Score score = test.Of(columns);
    for (std::size_t k = 0; k < bounds.size(); ++k) {
      looked += 1.0;
      const auto index = static_cast<Eigen::Index>(k);
      SurveyPart part = TestPart(score, index);
      if (!(part.chance < least.chance)) continue;
      const double from = bounds[k];
      part.name = NameOf(data, cut, from);
      part.points = static_cast<int>(
          std::count_if(cut.key.begin(), cut.key.end(), [&](double key) { return key > from; }));
      part.columns = columns.on_survey.middleRows(3 * kRigidSix * index, 3 * kRigidSix);
      least = std::move(part);
    }
  }
  out.chance = ChanceOfAny(std::min(least.chance, 1.0 - 1e-15), looked);
  if (!(out.chance < options.level)) return out;
  out.rms = RmsOf(least);
  out.sigma = std::sqrt(std::max(0.0, least.covariance.trace()));
  out.rise = test.RiseOfError({}, least.on_cameras,
                              least.motion * least.motion.transpose() + least.covariance);
  const std::string seen =
      fmt::format("{} of the surveyed places, {}, are off from the others as one, by {} RMS",
                  least.points, least.name, LengthText(out.rms));
  out.found = out.rise > options.harmless;
  out.text = out.found
                 ? seen +
                       ": was the station moved? Name the set-up of each point in a column "
                       "set_up, and how they are off is estimated; or measure some of them again"
                 : fmt::format(
                       "{}; it raises squared errors of found points by {:.1g}% of what is "
                       "stated",
                       seen, 100.0 * out.rise);
  return out;
}

}  // namespace unfurl::calib
