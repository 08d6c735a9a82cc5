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
#include "calib/common_error.h"
#include "calib/parameters.h"
#include "calib/score_test.h"
#include "calib/set_up.h"

namespace unfurl::calib {
namespace {

constexpr Eigen::Index kPartRigid = 6, kPartSeven = 7;  // unknowns of one: motion; and its scale
// Below: it is the scale that a found part is off by [-].
constexpr double kFoundScaleChance = 0.01;
// Of a survey that does not say from where it was measured: that a part of it is off [-].
constexpr double kPartProbability = 0.5;
// By how much then, each unknown, in sigmas of a point: less harms nothing, and more is found [-].
constexpr double kPartSigmas[] = {0.25, 0.5, 1.0, 2.0};
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

// Points in the order of one key; a part is those above a quantile of it, or a set-up's.
struct SurveyCut {
  std::string name;            // of the part; of what comes after a line, empty
  std::vector<double> key;     // of each point
  double sigma = 0.0;          // of a key
  Eigen::Index first = 0;      // of the seven: those before are in the fit
  std::vector<double> bounds;  // of the parts; empty: yet to be found

  Eigen::Index unknowns() const { return kPartSeven - first; }
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

std::vector<SurveyCut> CutsOf(const Observations& data, const Eigen::Vector3d& middle,
                              double sigma) {
  std::vector<SurveyCut> out;
  for (int k = kLattice * kLattice * kLattice / 2 + 1; k < kLattice * kLattice * kLattice; ++k) {
    const Eigen::Vector3i way =
        Eigen::Vector3i(k / (kLattice * kLattice), k / kLattice % kLattice, k % kLattice).array() -
        kLattice / 2;
    if (std::gcd(std::gcd(way.x(), way.y()), way.z()) > 1) continue;  // the half of another
    SurveyCut cut{"towards "};
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

// What each named set-up but the first measured: how it stood is in the fit, its scale is not.
std::vector<SurveyCut> NamedCuts(const Observations& data) {
  std::vector<SurveyCut> out;
  for (std::size_t k = 1; k < data.set_ups.size(); ++k) {
    SurveyCut cut{fmt::format("of set-up \"{}\"", data.set_ups[k].name),
                  std::vector<double>(data.ids.size(), 0.0)};
    for (const int i : PointsOf(data, static_cast<int>(k))) {
      cut.key[static_cast<std::size_t>(i)] = 1.0;
    }
    cut.first = kPartRigid;
    cut.bounds = {0.5};
    out.push_back(std::move(cut));
  }
  return out;
}

// Seven columns for each part of a cut: shifts [m], and turns and the scale by what moves points at
// `arm` as far. With the shifts it is the scale about any point, as that of a station's distances.
Columns ColumnsOf(const Observations& data, const SurveyCut& cut, const Eigen::Vector3d& middle,
                  double arm) {
  Columns out;
  const auto parts = static_cast<Eigen::Index>(cut.bounds.size());
  out.on_survey.setZero(3 * cut.unknowns() * parts, data.points());
  for (Eigen::Index part = 0; part < parts; ++part) {
    const double from = cut.bounds[static_cast<std::size_t>(part)];
    for (Eigen::Index i = 0; i < data.p.cols(); ++i) {
      if (!(cut.key[static_cast<std::size_t>(i)] > from)) continue;
      const Eigen::Vector3d r = (data.p.col(i) - middle) / arm;
      for (Eigen::Index k = cut.first; k < kPartSeven; ++k) {
        const Eigen::Vector3d axis = Eigen::Vector3d::Unit(k % 3);
        out.on_survey.block<3, 1>(3 * (cut.unknowns() * part + k - cut.first), i) =
            k < 3   ? axis
            : k < 6 ? Eigen::Vector3d(axis.cross(r))
                    : r;
      }
    }
  }
  return out;
}

// The same without what is a rigid motion of all places: that is the frame.
Columns WithoutFrame(const Observations& data, Columns columns) {
  for (Eigen::Index at = 0; at < columns.on_survey.rows(); at += 3) {
    columns.on_survey.middleRows(at, 3) =
        WithoutRigidMotion(data.p, columns.on_survey.middleRows(at, 3));
  }
  return columns;
}

// The least probable part so far.
struct SurveyPart {
  double chance = 1.0;  // of its own [-]
  std::string name;
  int points = 0;
  Eigen::MatrixXd columns;     // 3 m x points [-]
  Eigen::VectorXd motion;      // estimate, [m] at the arm
  Eigen::MatrixXd covariance;  // of it [m^2]
  Eigen::MatrixXd on_cameras;  // of a unit of each

  // The scale, which is the last, and its standard deviation [m] at the arm.
  double Scale() const { return motion(motion.size() - 1); }
  double ScaleSigma() const { return std::sqrt(std::max(covariance.diagonal().tail(1)(0), 0.0)); }
  bool ByScale() const {
    return ScaleSigma() > 0.0 &&
           ChiSquareTail(std::pow(Scale() / ScaleSigma(), 2), 1.0) < kFoundScaleChance;
  }
};

// Score, estimate and chance of one part's m unknowns.
SurveyPart TestPart(const ScoreTest::Score& score, Eigen::Index part, Eigen::Index m) {
  const Eigen::Index at = m * part;
  const Eigen::MatrixXd M = score.covariance.block(at, at, m, m);
  // In units of what each column told were nothing else unknown.
  const Eigen::VectorXd unit =
      score.whole.diagonal().segment(at, m).cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(unit.asDiagonal() * M *
                                                             unit.asDiagonal());
  Eigen::VectorXd inverse = Eigen::VectorXd::Zero(m);
  double freedom = 0.0;
  for (Eigen::Index k = 0; k < m; ++k) {
    if (!(eigen.eigenvalues()(k) > kScanLeft)) continue;
    inverse(k) = 1.0 / eigen.eigenvalues()(k);
    freedom += 1.0;
  }
  SurveyPart out;
  const Eigen::MatrixXd half = unit.asDiagonal() * eigen.eigenvectors();
  out.covariance = half * inverse.asDiagonal() * half.transpose();
  const Eigen::VectorXd value = score.value.segment(at, m);
  out.motion = out.covariance * value;
  if (freedom > 0.0) out.chance = ChiSquareTail(value.dot(out.motion), freedom);
  out.on_cameras = score.on_cameras.middleCols(at, m);
  return out;
}

std::string NameOf(const Observations& data, const SurveyCut& cut, double from) {
  if (!cut.name.empty()) return cut.name;
  const auto first = static_cast<std::size_t>(std::floor(from)) + 1;
  return fmt::format("from \"{}\" on, in the order of the file",
                     data.ids[std::min(first, data.ids.size() - 1)]);
}

// RMS displacement of the part's points.
double RmsOf(const SurveyPart& part) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < part.columns.cols(); ++i) {
    sum += (part.columns.col(i).reshaped(3, part.motion.size()) * part.motion).squaredNorm();
  }
  return std::sqrt(sum / std::max(1, part.points));
}

// What is seen of a part that is found, and what to do.
std::string TextOf(const SurveyPart& part, const Trend& trend, double arm) {
  std::string seen =
      fmt::format("{} of the surveyed places, {}, are off from the others as one, by {} RMS",
                  part.points, part.name, LengthText(trend.rms));
  if (part.ByScale()) {
    seen += fmt::format(", of which their scale is off by {:+.2g} +- {:.1g} thousandths",
                        1e3 * part.Scale() / arm, 1e3 * part.ScaleSigma() / arm);
  }
  if (!trend.found) {
    return fmt::format("{}; it raises squared errors of found points by {:.1g}% of what is stated",
                       seen, 100.0 * trend.rise);
  }
  if (part.ByScale()) {
    return seen +
           ": were distances measured otherwise (another prism, its constant, the correction for "
           "the air)? Measure some of them again";
  }
  return seen +
         ": was the station moved? Name the set-up of each point in a column set_up, and how they "
         "are off is estimated; or measure some of them again";
}

// Parts that may be off, with how probable the data make each: N(0, t^2) of each unknown, t of
// several sizes that are as probable as each other, and so are the parts.
class DoubtfulParts {
 public:
  explicit DoubtfulParts(double sigma) : sigma_(sigma) {}

  void Add(const ScoreTest::Score& score, Eigen::Index part) {
    constexpr Eigen::Index m = kPartSeven;
    using Square = Eigen::Matrix<double, m, m>;
    const Eigen::Index at = m * part;
    const Square M = score.covariance.block<m, m>(at, at);
    const Eigen::Matrix<double, m, 1> value = score.value.segment<m>(at);
    for (const double sigmas : kPartSigmas) {
      const double variance = std::pow(sigmas * sigma_, 2);
      const Eigen::LLT<Square> factor(Square(Square::Identity() + variance * M));
      const Square posterior = variance * factor.solve(Square::Identity());
      const Eigen::Matrix<double, m, 1> mean = posterior * value;
      // Of the data with it, over without.
      const double log_odds =
          0.5 * value.dot(mean) - factor.matrixLLT().diagonal().array().log().sum();
      moments_.push_back({log_odds, posterior + mean * mean.transpose()});
    }
    by_cameras_.push_back(score.on_cameras.middleCols(at, m));
  }

  // What not knowing of them adds to the covariance of the cameras, the first `size` rows.
  Eigen::MatrixXd Covariance(Eigen::Index size) const {
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(size, size);
    double most = 0.0;  // of the odds, against numbers too large
    for (const Moment& one : moments_) most = std::max(most, one.log_odds);
    const double each =
        kPartProbability / static_cast<double>(std::max<std::size_t>(1, moments_.size()));
    double sum = (1.0 - kPartProbability) * std::exp(-most);
    for (const Moment& one : moments_) sum += each * std::exp(one.log_odds - most);
    for (std::size_t part = 0; part < by_cameras_.size(); ++part) {
      Eigen::Matrix<double, kPartSeven, kPartSeven> moment;
      moment.setZero();
      for (std::size_t k = 0; k < std::size(kPartSigmas); ++k) {
        const Moment& one = moments_[part * std::size(kPartSigmas) + k];
        moment += each / sum * std::exp(one.log_odds - most) * one.moment;
      }
      const Eigen::MatrixXd by = by_cameras_[part].topRows(size);
      out += by * moment * by.transpose();
    }
    return out;
  }

 private:
  struct Moment {
    double log_odds = 0.0;
    Eigen::Matrix<double, kPartSeven, kPartSeven> moment;  // second, of the unknowns [m^2]
  };
  double sigma_ = 0.0;                       // of a point [m]
  std::vector<Moment> moments_;              // part by part, size by size
  std::vector<Eigen::MatrixXd> by_cameras_;  // of a unit of each unknown
};

double SigmaOfPoint(const Observations& data) {
  std::vector<double> sigmas;
  for (const Eigen::Matrix3d& cov : data.cov) sigmas.push_back(std::sqrt(cov.trace() / 3.0));
  return Median(sigmas);
}

}  // namespace

SetUpScan ScanSetUps(const Observations& data, const std::vector<CameraPrior>& priors,
                     const RefinedBundle& bundle, const TrendOptions& options) {
  SetUpScan out;
  Trend& trend = out.trend;
  trend.kind = TrendKind::kSurveyShape;
  const Eigen::Index size = kParameters * data.camera_count();
  out.covariance = Eigen::MatrixXd::Zero(size, size);
  if (data.points() < kFewestScanned) return out;
  const ScoreTest test(data, priors, bundle);
  const Eigen::Vector3d middle = data.p.rowwise().mean();
  const double arm =
      std::sqrt((data.p.colwise() - middle).squaredNorm() / static_cast<double>(data.points()));
  const double sigma = SigmaOfPoint(data);
  const bool named = !data.set_ups.empty();
  SurveyPart least;
  DoubtfulParts doubtful(sigma);
  double looked = 0.0;
  for (SurveyCut& cut : named ? NamedCuts(data) : CutsOf(data, middle, sigma)) {
    if (cut.bounds.empty()) cut.bounds = BoundsOf(cut);
    const Columns columns = ColumnsOf(data, cut, middle, arm);
    const ScoreTest::Score score = test.Of(WithoutFrame(data, columns));
    const Eigen::Index m = cut.unknowns();
    for (std::size_t k = 0; k < cut.bounds.size(); ++k) {
      looked += 1.0;
      const auto index = static_cast<Eigen::Index>(k);
      if (!data.set_ups_told) doubtful.Add(score, index);
      SurveyPart part = TestPart(score, index, m);
      if (!(part.chance < least.chance)) continue;
      const double from = cut.bounds[k];
      part.name = NameOf(data, cut, from);
      part.points = static_cast<int>(
          std::count_if(cut.key.begin(), cut.key.end(), [&](double key) { return key > from; }));
      part.columns = columns.on_survey.middleRows(3 * m * index, 3 * m);
      least = std::move(part);
    }
  }
  out.covariance = doubtful.Covariance(size);
  if (looked == 0.0) return out;
  trend.chance = ChanceOfAny(std::min(least.chance, 1.0 - 1e-15), looked);
  if (!(trend.chance < options.level)) return out;
  trend.rms = RmsOf(least);
  trend.sigma = std::sqrt(std::max(least.covariance.trace(), 0.0));
  trend.rise = test.RiseOfError({}, least.on_cameras,
                                least.motion * least.motion.transpose() + least.covariance);
  trend.found = trend.rise > options.harmless;
  trend.text = TextOf(least, trend, arm);
  return out;
}

}  // namespace unfurl::calib
