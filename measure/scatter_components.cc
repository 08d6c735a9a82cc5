#include "measure/scatter_components.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/dense.h"
#include "base/statistics.h"

namespace unfurl::measure {

namespace {

// Chance that sound readings are left out as wild: low, for what is left out is corrected for as if
// it were normal [-].
constexpr double kLeftOut = 1e-3;
constexpr int kScorings = 40;           // at most; they settle in five to fifteen
constexpr double kLeastSquare = 1e-12;  // of readings that do not scatter at all [-]
constexpr double kForgotten = 1e-6;     // odds of models that are not looked at [-]
constexpr double kSettled = 1e-4;       // of a factor squared, between two of them [-]

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

Components::Components(const std::vector<Triple>& triples, std::span<const CellSquare> cells,
                       std::size_t cameras)
    : triples_(triples),
      given_(cells),
      cameras_(static_cast<Eigen::Index>(cameras)),
      marks_(static_cast<Eigen::Index>(cells.size() / cameras)),
      known_(cells.size(), false) {
  for (const Triple& triple : triples) {
    const auto m = static_cast<std::size_t>(triple.y.size());
    for (std::size_t k = limits_.size(); k <= m; ++k) {
      const double n = static_cast<double>(k);
      limits_.push_back(k == 0 ? 0.0 : ChiSquareQuantile(1.0 - kLeftOut, n));
      kept_.push_back(k == 0 ? 1.0 : (1.0 - ChiSquareTail(limits_[k], n + 2.0)) / (1.0 - kLeftOut));
    }
    numbers_ += static_cast<double>(m);
    for (std::size_t c = 0; c < cameras; ++c) {
      const auto column = triple.part.col(static_cast<Eigen::Index>(c));
      if (column.squaredNorm() > 0.0) known_[triple.mark * cameras + c] = true;
    }
  }
  for (std::size_t k = 0; k < cells.size(); ++k) {
    numbers_ += cells[k].numbers;
    if (cells[k].numbers > 0.0) known_[k] = true;
  }
}

Sums Components::Collect(const Eigen::VectorXd& theta, const Eigen::VectorXd& by) const {
  Sums out{Eigen::VectorXd::Zero(cameras_ * marks_),
           std::vector<Eigen::MatrixXd>(static_cast<std::size_t>(marks_),
                                        Eigen::MatrixXd::Zero(cameras_, cameras_))};
  for (const Triple& triple : triples_) {
    const auto m = static_cast<std::size_t>(triple.y.size());
    const Eigen::Index first = static_cast<Eigen::Index>(triple.mark) * cameras_;
    if (!(ChiSquareOf(triple, theta.segment(first, cameras_)) < limits_[m])) continue;
    const Eigen::LLT<Eigen::MatrixXd> S = CovarianceOf(triple, by.segment(first, cameras_));
    const Eigen::VectorXd z = S.solve(triple.y);
    const Eigen::MatrixXd cross = triple.part.transpose() * S.solve(triple.part);
    const Eigen::VectorXd on = triple.part.transpose() * z;
    // A normal variable that is cut off at an ellipsoid has a covariance of the same shape.
    out.along.segment(first, cameras_) += on.cwiseAbs2() / kept_[m];
    out.fisher[triple.mark] += cross.cwiseAbs2();
    out.chi_square += triple.y.dot(z) / kept_[m];
    out.numbers += static_cast<double>(m);
  }
  for (std::size_t k = 0; k < given_.size(); ++k) {
    const CellSquare& cell = given_[k];
    if (!(cell.numbers > 0.0)) continue;
    const auto at = static_cast<Eigen::Index>(k), c = at % cameras_;
    out.along(at) += cell.numbers * cell.square / (by(at) * by(at));
    out.fisher[static_cast<std::size_t>(at / cameras_)](c, c) += cell.numbers / (by(at) * by(at));
    out.chi_square += cell.numbers * cell.square / by(at);
    out.numbers += cell.numbers;
  }
  return out;
}

double Components::Common() const {
  const Eigen::VectorXd one = Eigen::VectorXd::Ones(cameras_ * marks_);
  std::vector<double> ratios;
  for (const Triple& triple : triples_) {
    const auto m = static_cast<double>(triple.y.size());
    ratios.push_back(ChiSquareOf(triple, one.head(cameras_)) / ChiSquareQuantile(0.5, m));
  }
  for (const CellSquare& cell : given_) {
    if (ratios.size() < triples_.size() + given_.size() && cell.numbers > 0.0) {
      ratios.push_back(cell.square);
    }
  }
  double theta = std::max(Median(ratios), kLeastSquare);
  for (int k = 0; k < kScorings; ++k) {
    const Sums sums = Collect(theta * one, one);
    const double was = theta;
    if (sums.numbers > 0.0) theta = std::max(sums.chi_square / sums.numbers, kLeastSquare);
    if (std::abs(theta - was) < kSettled * was) break;
  }
  return theta;
}

std::vector<Components::Model> Components::Models() const {
  const auto C = static_cast<std::size_t>(cameras_), cells = known_.size();
  std::vector<Model> out;
  const auto add = [&](ScatterOwner owner, const auto& number_of) {
    Model model;
    model.owner = owner;
    // What nothing tells has no number; cells of a camera or a mark share what others of it tell.
    std::map<std::ptrdiff_t, int> numbers = {{-1, -1}};
    for (std::size_t k = 0; k < cells; ++k) {
      if (known_[k]) numbers.try_emplace(number_of(k), static_cast<int>(numbers.size()) - 1);
    }
    for (std::size_t k = 0; k < cells; ++k) {
      const auto at = numbers.find(number_of(k));
      model.shared.push_back(at == numbers.end() ? -1 : at->second);
    }
    if (numbers.size() > 1) out.push_back(std::move(model));
  };
  const auto camera = [&](std::size_t k) { return static_cast<std::ptrdiff_t>(k % C); };
  const auto mark = [&](std::size_t k) { return static_cast<std::ptrdiff_t>(k / C); };
  const auto cell = [&](std::size_t k) { return static_cast<std::ptrdiff_t>(k); };
  const auto add_each = [&](ScatterOwner owner, const auto& of, std::size_t count) {
    add(owner, of);
    for (std::size_t one = 0; one < count; ++one) {
      add(owner, [&](std::size_t k) { return of(k) == static_cast<std::ptrdiff_t>(one) ? 0 : -1; });
    }
  };
  add(ScatterOwner::kAll, [](std::size_t) { return std::ptrdiff_t{0}; });
  add_each(ScatterOwner::kCameras, camera, C);
  add_each(ScatterOwner::kMarks, mark, cells / C);
  // A cell by itself is told by its own readings' course, hardly by what is left over of places.
  add_each(ScatterOwner::kCells, cell, triples_.empty() ? cells : 0);
  return out;
}

Eigen::MatrixXd Components::Means() const {
  const Eigen::Index cells = cameras_ * marks_;
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(cells + cameras_ + marks_, cells);
  out.topRows(cells).setIdentity();
  for (Eigen::Index k = 0; k < cells; ++k) {
    out(cells + k % cameras_, k) = 1.0 / static_cast<double>(marks_);
    out(cells + cameras_ + k / cameras_, k) = 1.0 / static_cast<double>(cameras_);
  }
  return out;
}

Components::Found Components::Each(double common, double least) const {
  const double level = std::max(common, least);
  std::vector<Model> models = Models();
  double best = HUGE_VAL, whole = 0.0;
  Found out;
  for (Model& model : models) {
    Fit(level, least, &model);
    if (model.loss >= best) continue;
    best = model.loss;
    out.owner = model.owner;
  }
  const Eigen::MatrixXd means = Means();
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(means.rows()), square = sum;
  for (const Model& model : models) {
    const double weight = std::exp(0.5 * (best - model.loss));
    if (weight < kForgotten) continue;
    Eigen::MatrixXd moves = Eigen::MatrixXd::Zero(means.rows(), model.spread.cols());
    for (std::size_t k = 0; k < model.shared.size(); ++k) {
      if (model.shared[k] < 0) continue;
      moves.col(model.shared[k]) += means.col(static_cast<Eigen::Index>(k));
    }
    const Eigen::VectorXd mean = means * model.theta;
    whole += weight;
    sum += weight * mean;
    square +=
        weight * ((moves * model.spread).cwiseProduct(moves).rowwise().sum() + mean.cwiseAbs2());
  }
  out.square = sum / whole;
  out.sigma = (square / whole - out.square.cwiseAbs2()).cwiseMax(0.0).cwiseSqrt();
  return out;
}

// A cell of which nothing is known is as all are, or stays as stated where the others do.
void Components::Fit(double level, double least, Model* model) const {
  const auto count = 1 + *std::max_element(model->shared.begin(), model->shared.end());
  const Eigen::VectorXd alike = Eigen::VectorXd::Constant(cameras_ * marks_, level);
  model->theta = alike;
  if (model->owner == ScatterOwner::kAll) {
    model->spread = Eigen::MatrixXd::Constant(1, 1, 2.0 * level * level / numbers_);
  } else {
    model->theta.setOnes();
    model->spread = Eigen::MatrixXd::Zero(count, count);
    Score(level, least, model);
  }
  model->loss = LossOf(model->theta, alike) + static_cast<double>(count) * std::log(numbers_);
}

void Components::Score(double level, double least, Model* out) const {
  constexpr double kDrawn = 3.0;  // towards the common one, of it: hardly, where anything tells
  const Eigen::Index n = out->spread.rows();
  const double weight = 1.0 / (kDrawn * kDrawn * level * level);
  const std::vector<int>& shared = out->shared;
  Eigen::VectorXd found = Eigen::VectorXd::Constant(n, level);
  for (int round = 0; round < kScorings; ++round) {
    for (std::size_t k = 0; k < shared.size(); ++k) {
      if (shared[k] >= 0) out->theta(static_cast<Eigen::Index>(k)) = found(shared[k]);
    }
    const Sums sums = Collect(out->theta, out->theta);
    Eigen::MatrixXd A = weight * Eigen::MatrixXd::Identity(n, n);
    Eigen::VectorXd b = Eigen::VectorXd::Constant(n, weight * level);
    for (std::size_t k = 0; k < shared.size(); ++k) {
      if (shared[k] < 0) continue;
      const auto at = static_cast<Eigen::Index>(k), c = at % cameras_, first = at - c;
      const Eigen::MatrixXd& fisher = sums.fisher[static_cast<std::size_t>(at / cameras_)];
      b(shared[k]) += 0.5 * sums.along(at);
      for (Eigen::Index d = 0; d < cameras_; ++d) {
        const int other = shared[static_cast<std::size_t>(first + d)];
        if (other >= 0) A(shared[k], other) += 0.5 * fisher(c, d);
        if (other < 0) b(shared[k]) -= 0.5 * fisher(c, d) * out->theta(first + d);
      }
    }
    const Eigen::VectorXd x = SolveAbove(A, b, least), was = found;
    found = 0.5 * (was + x);  // it may go to and fro about its end
    out->spread = A.llt().solve(Eigen::MatrixXd::Identity(n, n));
    if ((x - was).cwiseAbs().maxCoeff() < kSettled * level) break;
  }
  const Eigen::VectorXd last = found;
  for (std::size_t k = 0; k < shared.size(); ++k) {
    if (shared[k] >= 0) out->theta(static_cast<Eigen::Index>(k)) = last(shared[k]);
  }
  // Where each has its own, one that nothing tells is like the rest.
  if (n < 2) return;
  for (std::size_t k = 0; k < shared.size(); ++k) {
    if (shared[k] < 0) out->theta(static_cast<Eigen::Index>(k)) = level;
  }
}

// -2 ln of the likelihood; what is wild costs the same whatever the factors are.
double Components::LossOf(const Eigen::VectorXd& theta, const Eigen::VectorXd& alike) const {
  double loss = 0.0;
  for (const Triple& triple : triples_) {
    const auto m = static_cast<std::size_t>(triple.y.size());
    const Eigen::Index first = static_cast<Eigen::Index>(triple.mark) * cameras_;
    const double wild =
        LogDeterminant(CovarianceOf(triple, alike.segment(first, cameras_))) + limits_[m];
    const Eigen::LLT<Eigen::MatrixXd> S = CovarianceOf(triple, theta.segment(first, cameras_));
    loss += std::min(wild, LogDeterminant(S) + triple.y.dot(S.solve(triple.y)));
  }
  for (std::size_t k = 0; k < given_.size(); ++k) {
    const double square = theta(static_cast<Eigen::Index>(k));
    if (!(given_[k].numbers > 0.0)) continue;
    loss += given_[k].numbers * (std::log(square) + given_[k].square / square);
  }
  return loss;
}

}  // namespace unfurl::measure
