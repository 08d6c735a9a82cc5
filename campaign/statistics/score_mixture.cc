#include "campaign/statistics/score_mixture.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "base/statistics.h"

namespace unfurl::campaign {

namespace {

using Component = ScoreMixture::Component;

constexpr int kMostComponents = 8;  // failure regions that a few hundred points can tell apart
constexpr int kIterations = 40;     // of expectation and maximisation: means move by less than 1%
// Above it a sample covariance of some hundred points shows single directions no more, and its
// eigenvectors cost seconds.
constexpr Eigen::Index kMostForAxes = 300;

struct Clusters {
  Eigen::MatrixXd means;             // d x k
  Eigen::VectorXd shares;            // k
  Eigen::MatrixXd responsibilities;  // n x k
  double log_likelihood = 0.0;       // mean over points
};

// Responsibilities and likelihood under unit covariances.
void Expect(const Eigen::MatrixXd& points, const Eigen::VectorXd& weights, Clusters* c) {
  const Eigen::Index n = points.cols(), k = c->means.cols();
  c->responsibilities.resize(n, k);
  c->log_likelihood = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::RowVectorXd log(k);
    for (Eigen::Index j = 0; j < k; ++j) {
      log[j] = std::log(c->shares[j]) - 0.5 * (points.col(i) - c->means.col(j)).squaredNorm();
    }
    const double most = log.maxCoeff();
    const double sum = (log.array() - most).exp().sum();
    c->responsibilities.row(i) = ((log.array() - most).exp() / sum).matrix();
    c->log_likelihood += weights[i] * (most + std::log(sum));
  }
}

// Centres far from each other: each next with probability by its square distance from those there
// [Arthur and Vassilvitskii 2007].
Eigen::MatrixXd SpreadCentres(const Eigen::MatrixXd& points, const Eigen::VectorXd& weights, int k,
                              const CounterRandom& random) {
  Eigen::MatrixXd centres(points.rows(), k);
  Eigen::VectorXd mass = weights;
  Eigen::VectorXd nearest =
      Eigen::VectorXd::Constant(points.cols(), std::numeric_limits<double>::infinity());
  for (int j = 0; j < k; ++j) {
    double at =
        random.Uniform(static_cast<std::uint64_t>(k), static_cast<std::uint32_t>(j)) * mass.sum();
    Eigen::Index i = 0;
    while (i + 1 < mass.size() && (at -= mass[i]) > 0.0) ++i;
    centres.col(j) = points.col(i);
    nearest =
        nearest.cwiseMin((points.colwise() - centres.col(j)).colwise().squaredNorm().transpose());
    mass = weights.cwiseProduct(nearest);
  }
  return centres;
}

Clusters ClustersOf(const Eigen::MatrixXd& points, const Eigen::VectorXd& weights, int k,
                    const CounterRandom& random) {
  Clusters c{
      SpreadCentres(points, weights, k, random), Eigen::VectorXd::Constant(k, 1.0 / k), {}, 0.0};
  constexpr double kEmpty = 1e-9;  // a share that keeps its logarithm
  for (int iteration = 0; iteration < (k == 1 ? 1 : kIterations); ++iteration) {
    Expect(points, weights, &c);
    const Eigen::MatrixXd r = weights.asDiagonal() * c.responsibilities;
    c.shares = r.colwise().sum().transpose().cwiseMax(kEmpty);
    c.means = points * r * c.shares.cwiseInverse().asDiagonal();
    c.shares /= c.shares.sum();
  }
  Expect(points, weights, &c);
  return c;
}

// Width of a component from its points' covariance.
void Widen(const Eigen::MatrixXd& points, const Eigen::VectorXd& r, double effective,
           Component* component) {
  const Eigen::Index d = points.rows();
  const double n = std::max(effective, 2.0), dims = static_cast<double>(d);
  const Eigen::MatrixXd off = points.colwise() - component->mean;
  const double all = (off.colwise().squaredNorm() * r).value() / r.sum() / dims;
  // A mean variance of n points of d scores has the error sqrt(2 / (n d)): three of them.
  if (all > 1.0 + 3.0 * std::sqrt(2.0 / (n * dims))) component->variance = all;
  if (d > kMostForAxes) return;
  const Eigen::MatrixXd covariance = off * r.asDiagonal() * off.transpose() / r.sum();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance);
  // Eigenvalues of a sample covariance of pure noise reach (1 + sqrt(d / n))^2 [Marchenko and
  // Pastur 1967].
  const double edge = component->variance * std::pow(1.0 + std::sqrt(dims / n), 2.0);
  const Eigen::VectorXd& values = eigen.eigenvalues();
  const Eigen::Index wider = (values.array() > edge).count();
  component->axes = eigen.eigenvectors().rightCols(wider);
  component->variances = values.tail(wider);
}

double LogDensity(const Component& c, const Eigen::VectorXd& z) {
  const Eigen::VectorXd off = z - c.mean;
  double square = off.squaredNorm() / c.variance;
  double log_det = static_cast<double>(z.size() - c.variances.size()) * std::log(c.variance);
  if (c.variances.size() > 0) {
    const Eigen::VectorXd along = c.axes.transpose() * off;
    square += (along.array().square() * (c.variances.array().inverse() - 1.0 / c.variance)).sum();
    log_det += c.variances.array().log().sum();
  }
  return -0.5 * (square + log_det);  // without (2 pi)^(-d/2), which all densities here share
}

}  // namespace

ScoreMixture::ScoreMixture(const Eigen::MatrixXd& points, const Eigen::VectorXd& weights,
                           double effective, double wide, std::uint64_t seed) {
  constexpr std::uint32_t kCentres = 20;  // stream of random numbers
  const CounterRandom random(seed, kCentres);
  const Eigen::VectorXd shares = weights / weights.sum();
  const double d = static_cast<double>(points.rows());
  Clusters best;
  double least = std::numeric_limits<double>::infinity();
  for (int k = 1; k <= kMostComponents && k <= points.cols(); ++k) {
    Clusters c = ClustersOf(points, shares, k, random);
    const double criterion = -2.0 * effective * c.log_likelihood +
                             (k * (d + 1.0) - 1.0) * std::log(std::max(effective, 2.0));
    if (criterion >= least) continue;
    least = criterion;
    best = std::move(c);
  }
  for (Eigen::Index j = 0; j < best.means.cols(); ++j) {
    Component component;
    component.weight = (1.0 - wide) * best.shares[j];
    component.mean = best.means.col(j);
    const Eigen::VectorXd r = shares.cwiseProduct(best.responsibilities.col(j));
    Widen(points, r, effective * best.shares[j], &component);
    components_.push_back(std::move(component));
  }
  if (!(wide > 0.0)) return;
  Component all;
  all.weight = wide;
  all.mean = Eigen::VectorXd::Zero(points.rows());
  all.variance = std::max(1.0, points.colwise().squaredNorm().dot(shares.transpose()) / d);
  components_.push_back(std::move(all));
}

Eigen::VectorXd ScoreMixture::Draw(const CounterRandom& random, std::uint64_t index) const {
  const Eigen::Index d = components_.front().mean.size();
  double at = random.Uniform(index, static_cast<std::uint32_t>(d));
  std::size_t which = 0;
  while (which + 1 < components_.size() && (at -= components_[which].weight) > 0.0) ++which;
  const Component& c = components_[which];
  Eigen::VectorXd z(d);
  random.Normals(index, {z.data(), static_cast<std::size_t>(d)});
  z *= std::sqrt(c.variance);
  if (c.variances.size() > 0) {
    const Eigen::VectorXd along = c.axes.transpose() * z;
    z += c.axes * (along.array() * ((c.variances.array() / c.variance).sqrt() - 1.0)).matrix();
  }
  return z + c.mean;
}

double ScoreMixture::LogWeight(const Eigen::VectorXd& z) const {
  double most = -std::numeric_limits<double>::infinity(), sum = 0.0;
  for (const Component& c : components_) {
    const double log = std::log(c.weight) + LogDensity(c, z);
    if (log > most) {
      sum = sum * std::exp(most - log) + 1.0;
      most = log;
    } else {
      sum += std::exp(log - most);
    }
  }
  return -0.5 * z.squaredNorm() - most - std::log(sum);
}

}  // namespace unfurl::campaign
