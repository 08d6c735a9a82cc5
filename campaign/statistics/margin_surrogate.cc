#include "campaign/statistics/margin_surrogate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/dense.h"
#include "base/probability.h"
#include "base/statistics.h"
#include "campaign/statistics/counter_random.h"
#include "campaign/statistics/subset.h"

namespace unfurl::campaign {

namespace {

// More coefficients take seconds to fit and thousands of points to know.
constexpr Eigen::Index kMostCoefficients = 600;
constexpr Eigen::Index kPointsEach = 3;  // of a coefficient, for a leave-one-out error to mean much
// Planes of more inputs take seconds to fit, and ask for more points than there are.
constexpr Eigen::Index kMostForPlanes = 200;
constexpr int kPointsEachOfPlane = 2;  // fewer, since a plane of a series seldom is the least
constexpr double kWidth = 2.0;         // of the errors of the surrogate, see SurrogateProposal
constexpr std::uint32_t kPick = 28;    // stream of random numbers

Eigen::Index CoefficientsOf(int degree, Eigen::Index d) {
  return degree == 1 ? 1 + d : degree == 2 ? 1 + 2 * d : 1 + d + d * (d + 1) / 2;
}

// The terms of one point, in this order: 1, z, squares, products.
void Terms(int degree, const Eigen::VectorXd& z, Eigen::Ref<Eigen::VectorXd> terms) {
  const Eigen::Index d = z.size();
  terms[0] = 1.0;
  terms.segment(1, d) = z;
  if (degree >= 2) terms.segment(1 + d, d) = z.cwiseAbs2();
  if (degree < 3) return;
  Eigen::Index at = 1 + 2 * d;
  for (Eigen::Index i = 0; i + 1 < d; ++i) {
    terms.segment(at, d - 1 - i) = z[i] * z.tail(d - 1 - i);
    at += d - 1 - i;
  }
}

struct FitNear {
  int degree = 1;
  Eigen::VectorXd coefficients;
  double square = 0.0, count = 0.0;  // of the leave-one-out residuals of points that decide
  double Error() const {
    return count > 0.0 ? std::sqrt(square / count) : std::numeric_limits<double>::infinity();
  }
};

FitNear Solve(int degree, const Eigen::MatrixXd& points, const Eigen::VectorXd& margins,
              double near) {
  const Eigen::Index n = points.cols(), m = CoefficientsOf(degree, points.rows());
  FitNear fit{.degree = degree};
  if (n < kPointsEach * m || m > kMostCoefficients) return fit;
  Eigen::MatrixXd terms(m, n);
  for (Eigen::Index i = 0; i < n; ++i) Terms(degree, points.col(i), terms.col(i));
  const Eigen::LLT<Eigen::MatrixXd> normal((terms * terms.transpose()).eval());
  if (normal.info() != Eigen::Success) return fit;
  fit.coefficients = normal.solve(terms * margins);
  const Eigen::VectorXd residuals = margins - terms.transpose() * fit.coefficients;
  const Eigen::MatrixXd half = normal.matrixL().solve(terms);
  constexpr double kOwn = 1e-12;  // a point that alone decides a coefficient tells nothing of it
  for (Eigen::Index i = 0; i < n; ++i) {
    if (margins[i] > near) continue;
    const double leverage = std::min(half.col(i).squaredNorm(), 1.0 - kOwn);
    fit.square += std::pow(residuals[i] / (1.0 - leverage), 2.0);
    fit.count += 1.0;
  }
  return fit;
}

// The best of all degrees, from all points, or from those near alone, which a bent margin asks for.
FitNear BestOf(const Eigen::MatrixXd& points, const Eigen::VectorXd& margins, double near) {
  std::vector<Eigen::Index> close;
  for (Eigen::Index i = 0; i < margins.size(); ++i) {
    if (margins[i] <= near) close.push_back(i);
  }
  FitNear best;
  for (int degree = 1; degree <= 3; ++degree) {
    for (const bool local : {false, true}) {
      FitNear fit = local ? Solve(degree, points(Eigen::all, close), margins(close), near)
                          : Solve(degree, points, margins, near);
      if (fit.Error() < best.Error()) best = std::move(fit);
    }
  }
  return best;
}

Eigen::Index Nearest(const Eigen::MatrixXd& centres, const Eigen::VectorXd& z) {
  Eigen::Index which = 0;
  if (centres.cols() > 1) (centres.colwise() - z).colwise().squaredNorm().minCoeff(&which);
  return which;
}

// Runs a subset simulation of the surrogate's margin plus noise, the last input, to its end.
void Drive(const MarginSurrogate& surrogate, double width, int dimensions,
           SubsetSimulation* subset) {
  std::vector<double> margins;
  while (!subset->Done()) {
    margins.clear();
    for (const std::vector<double>& point : subset->Batch()) {
      const Eigen::Map<const Eigen::VectorXd> z(point.data(), dimensions);
      margins.push_back(surrogate.Margin(z) + width * point.back());
    }
    subset->Answer(margins);
  }
}

}  // namespace

std::optional<MarginSurrogate> MarginSurrogate::Fit(const Eigen::MatrixXd& points,
                                                    std::span<const double> margins, double near,
                                                    const Eigen::MatrixXd& centres) {
  const Eigen::Map<const Eigen::VectorXd> all(margins.data(),
                                              static_cast<Eigen::Index>(margins.size()));
  FitNear one = BestOf(points, all, near);
  if (!std::isfinite(one.Error())) return {};
  MarginSurrogate surrogate;
  surrogate.error_ = one.Error();
  surrogate.centres_ = Eigen::MatrixXd::Zero(points.rows(), 1);
  surrogate.pieces_ = {{one.degree, one.coefficients}};
  if (centres.cols() > 1) surrogate.TryRegions(points, all, near, centres);
  // What is met to rounding needs no more planes.
  const double scatter = std::sqrt((all.array() - all.mean()).square().mean());
  constexpr double kExact = 1e-9;  // of the margins' scatter
  if (points.rows() > kMostForPlanes || surrogate.error_ < kExact * scatter) return surrogate;
  LeastOfPlanes planes = FitLeastOfPlanes(points, all, near, kPointsEachOfPlane);
  if (planes.error < surrogate.error_) {
    surrogate.error_ = planes.error;
    surrogate.planes_ = std::move(planes);
  }
  return surrogate;
}

void MarginSurrogate::TryRegions(const Eigen::MatrixXd& points, const Eigen::VectorXd& margins,
                                 double near, const Eigen::MatrixXd& centres) {
  std::vector<std::vector<Eigen::Index>> of(static_cast<std::size_t>(centres.cols()));
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    of[static_cast<std::size_t>(Nearest(centres, points.col(i)))].push_back(i);
  }
  std::vector<Piece> pieces;
  double square = 0.0, count = 0.0;
  for (const auto& own : of) {
    const FitNear piece = BestOf(points(Eigen::all, own), margins(own), near);
    if (!std::isfinite(piece.Error())) return;  // a region with too few points
    square += piece.square;
    count += piece.count;
    pieces.push_back({piece.degree, piece.coefficients});
  }
  const double error = std::sqrt(square / count);
  if (error >= error_) return;
  error_ = error;
  centres_ = centres;
  pieces_ = std::move(pieces);
}

double MarginSurrogate::Margin(const Eigen::VectorXd& z) const {
  if (planes_) return planes_->At(z);
  const Piece& piece = pieces_[static_cast<std::size_t>(Nearest(centres_, z))];
  Eigen::VectorXd terms(piece.coefficients.size());
  Terms(piece.degree, z, terms);
  return terms.dot(piece.coefficients);
}

// The surrogate's margin plus noise of the width is negative with probability h(z): a subset
// simulation with one input more gives the normalisation and draws at once. Replicates of it tell
// the normalisation's error by their scatter.
std::optional<SurrogateProposal> SurrogateProposal::Make(MarginSurrogate surrogate, int dimensions,
                                                         int draws, int evaluations,
                                                         std::uint64_t seed) {
  SurrogateProposal proposal(std::move(surrogate));
  // A surrogate without error still gets a width, of what a double's margin can resolve.
  proposal.width_ =
      std::max(kWidth * proposal.surrogate_.error(), std::numeric_limits<double>::min());
  proposal.draws_.resize(dimensions, draws);
  std::vector<double> masses;
  Eigen::Index drawn = 0;
  for (int k = 1; k <= kReplicates; ++k) {
    SubsetSimulation subset({.dimensions = dimensions + 1,
                             .runs_per_level = evaluations / kReplicates,
                             .seed = SplitMix(seed, static_cast<std::uint64_t>(k)),
                             .sample_failures = true,
                             .in_scores = true});
    Drive(proposal.surrogate_, proposal.width_, dimensions, &subset);
    const Eigen::MatrixXd failures = subset.Failures();
    const Eigen::Index end = static_cast<Eigen::Index>(draws) * k / kReplicates;
    if (subset.result().end != SubsetEnd::kReached || failures.cols() < end - drawn) return {};
    masses.push_back(subset.result().probability);
    const KeyedPermutation order(static_cast<std::uint64_t>(failures.cols()),
                                 CounterRandom(seed, kPick).Bits(static_cast<std::uint64_t>(k), 0));
    for (std::uint64_t i = 0; drawn < end; ++i, ++drawn) {
      proposal.draws_.col(drawn) =
          failures.col(static_cast<Eigen::Index>(order(i))).head(dimensions);
    }
  }
  proposal.mass_ = Mean(masses);
  proposal.variation_ = std::sqrt(Variance(masses) / kReplicates) / proposal.mass_;
  // In no order of replicates, so that the first draws are of all of them.
  const auto n = static_cast<std::uint64_t>(draws);
  const KeyedPermutation shuffle(n, CounterRandom(seed, kPick).Bits(0, 0));
  std::vector<Eigen::Index> order;
  for (std::uint64_t i = 0; i < n; ++i) order.push_back(static_cast<Eigen::Index>(shuffle(i)));
  proposal.draws_ = proposal.draws_(Eigen::all, order).eval();
  return proposal;
}

double SurrogateProposal::Ratio(const Eigen::VectorXd& z) const {
  return NormalCdf(-surrogate_.Margin(z) / width_) / mass_;
}

}  // namespace unfurl::campaign
