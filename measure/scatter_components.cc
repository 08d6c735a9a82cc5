#include "measure/scatter_components.h"

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "base/statistics.h"

namespace unfurl::measure {

namespace {

// Chance that sound readings are left out as wild: low, for what is left out is corrected for as if
// it were normal [-].
constexpr double kLeftOut = 1e-3;
constexpr int kScorings = 40;      // at most; they settle in five to fifteen
constexpr double kSettled = 1e-4;  // of a factor squared, between two of them [-]

Eigen::LLT<Eigen::MatrixXd> CovarianceOf(const Triple& triple, const Eigen::VectorXd& theta) {
  return Eigen::LLT<Eigen::MatrixXd>(triple.part * theta.asDiagonal() * triple.part.transpose());
}

double ChiSquareOf(const Triple& triple, const Eigen::VectorXd& theta) {
  return triple.y.dot(CovarianceOf(triple, theta).solve(triple.y));
}

double LogDeterminant(const Eigen::LLT<Eigen::MatrixXd>& S) {
  return 2.0 * Eigen::MatrixXd(S.matrixL()).diagonal().array().log().sum();
}

// A x = b with no x below `least`: those that would be are held there, one after another.
Eigen::VectorXd SolveAbove(const Eigen::MatrixXd& A, const Eigen::VectorXd& b, double least) {
  std::vector<Eigen::Index> free;
  for (Eigen::Index k = 0; k < b.size(); ++k) free.push_back(k);
  Eigen::VectorXd x = Eigen::VectorXd::Constant(b.size(), least);
  while (!free.empty()) {
    Eigen::VectorXd held = x;
    for (const Eigen::Index k : free) held(k) = 0.0;
    const Eigen::VectorXd rest = b - A * held;
    const Eigen::VectorXd found = A(free, free).llt().solve(rest(free));
    Eigen::Index lowest = 0;
    if (found.minCoeff(&lowest) >= least) {
      x(free) = found;
      return x;
    }
    free.erase(free.begin() + lowest);
  }
  return x;
}

}  // namespace

Components::Components(const std::vector<Triple>& triples, std::size_t cameras)
    : triples_(triples), cameras_(static_cast<Eigen::Index>(cameras)) {
  for (const Triple& triple : triples) {
    const auto m = static_cast<std::size_t>(triple.y.size());
    for (std::size_t k = limits_.size(); k <= m; ++k) {
      const double n = static_cast<double>(k);
      limits_.push_back(k == 0 ? 0.0 : ChiSquareQuantile(1.0 - kLeftOut, n));
      kept_.push_back(k == 0 ? 1.0 : (1.0 - ChiSquareTail(limits_[k], n + 2.0)) / (1.0 - kLeftOut));
    }
  }
}

Sums Components::Collect(const Eigen::VectorXd& theta, const Eigen::VectorXd& by) const {
  Sums out{Eigen::VectorXd::Zero(cameras_), Eigen::MatrixXd::Zero(cameras_, cameras_)};
  for (const Triple& triple : triples_) {
    const auto m = static_cast<std::size_t>(triple.y.size());
    if (!(ChiSquareOf(triple, theta) < limits_[m])) continue;
    const Eigen::LLT<Eigen::MatrixXd> S = CovarianceOf(triple, by);
    const Eigen::VectorXd z = S.solve(triple.y);
    const Eigen::MatrixXd cross = triple.part.transpose() * S.solve(triple.part);
    const Eigen::VectorXd on = triple.part.transpose() * z;
    // A normal variable that is cut off at an ellipsoid has a covariance of the same shape.
    out.along += on.cwiseAbs2() / kept_[m];
    out.fisher += cross.cwiseAbs2();
    out.chi_square += triple.y.dot(z) / kept_[m];
    out.numbers += static_cast<double>(m);
  }
  return out;
}

double Components::Common() const {
  const Eigen::VectorXd one = Eigen::VectorXd::Ones(cameras_);
  std::vector<double> ratios;
  for (const Triple& triple : triples_) {
    const auto m = static_cast<double>(triple.y.size());
    ratios.push_back(ChiSquareOf(triple, one) / ChiSquareQuantile(0.5, m));
  }
  double theta = std::max(Median(ratios), 1e-12);
  for (int k = 0; k < kScorings; ++k) {
    const Sums sums = Collect(theta * one, one);
    const double was = theta;
    if (sums.numbers > 0.0) theta = std::max(sums.chi_square / sums.numbers, 1e-12);
    if (std::abs(theta - was) < kSettled * was) break;
  }
  return theta;
}

Eigen::VectorXd Components::Each(double common, double least, Eigen::MatrixXd* covariance) const {
  const double level = std::max(common, least);
  const Eigen::VectorXd alike = Eigen::VectorXd::Constant(cameras_, level);
  std::vector<Model> models = {Fit(alike, {}, level)};
  for (Eigen::Index c = 0; c < cameras_; ++c) models.push_back(Fit(alike, {c}, least));
  std::vector<Eigen::Index> all;
  for (Eigen::Index c = 0; c < cameras_; ++c) all.push_back(c);
  models.push_back(Fit(alike, all, least));
  double best = HUGE_VAL, whole = 0.0;
  for (const Model& model : models) best = std::min(best, model.loss);
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(cameras_);
  Eigen::MatrixXd square = Eigen::MatrixXd::Zero(cameras_, cameras_);
  for (const Model& model : models) {
    const double weight = std::exp(0.5 * (best - model.loss));
    whole += weight;
    mean += weight * model.theta;
    square += weight * (model.covariance + model.theta * model.theta.transpose());
  }
  mean /= whole;
  *covariance = square / whole - mean * mean.transpose();
  return mean;
}

// Those of `free` cameras, the others' 1; of none: all are `alike`, which is one number, too.
Components::Model Components::Fit(const Eigen::VectorXd& alike,
                                  const std::vector<Eigen::Index>& free, double least) const {
  const double level = alike(0);
  Model out{alike, Eigen::MatrixXd::Zero(cameras_, cameras_)};
  double numbers = 0.0;
  for (const Triple& triple : triples_) numbers += static_cast<double>(triple.y.size());
  if (free.empty()) {
    out.covariance.setConstant(2.0 * level * level / numbers);
  } else {
    out.theta.setOnes();
    for (const Eigen::Index c : free) out.theta(c) = level;
    Score(level, least, free, &out);
  }
  out.loss = LossOf(out.theta, alike) +
             static_cast<double>(std::max<std::size_t>(1, free.size())) * std::log(numbers);
  return out;
}

void Components::Score(double level, double least, const std::vector<Eigen::Index>& free,
                       Model* out) const {
  constexpr double kDrawn = 3.0;  // towards the common one, of it: hardly, where anything tells
  const auto n = static_cast<Eigen::Index>(free.size());
  const double weight = 1.0 / (kDrawn * kDrawn * level * level);
  for (int k = 0; k < kScorings; ++k) {
    const Sums sums = Collect(out->theta, out->theta);
    Eigen::VectorXd others = out->theta;
    for (const Eigen::Index c : free) others(c) = 0.0;
    const Eigen::VectorXd rest = 0.5 * (sums.along - sums.fisher * others);
    Eigen::MatrixXd A = 0.5 * sums.fisher(free, free);
    A.diagonal().array() += weight;
    const Eigen::VectorXd b = rest(free).array() + weight * level;
    const Eigen::MatrixXd C = A.llt().solve(Eigen::MatrixXd::Identity(n, n));
    const Eigen::VectorXd x = SolveAbove(A, b, least);
    const Eigen::VectorXd was = out->theta(free);
    out->theta(free) = 0.5 * (was + x);  // it may go to and fro about its end
    out->covariance(free, free) = C;
    if ((x - was).cwiseAbs().maxCoeff() < kSettled * level) break;
  }
}

// -2 ln of the likelihood; what is wild costs the same whatever the factors are.
double Components::LossOf(const Eigen::VectorXd& theta, const Eigen::VectorXd& alike) const {
  double loss = 0.0;
  for (const Triple& triple : triples_) {
    const auto m = static_cast<std::size_t>(triple.y.size());
    const double wild = LogDeterminant(CovarianceOf(triple, alike)) + limits_[m];
    const Eigen::LLT<Eigen::MatrixXd> S = CovarianceOf(triple, theta);
    loss += std::min(wild, LogDeterminant(S) + triple.y.dot(S.solve(triple.y)));
  }
  return loss;
}

}  // namespace unfurl::measure
