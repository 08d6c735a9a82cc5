#include "correlate/modes/decay_problem.h"

#include <algorithm>
#include <cmath>

#include "base/dense.h"

namespace unfurl::correlate {

DecayProblem::DecayProblem(std::span<const DecaySignal> signals, int trend)
    : signals_(signals), trend_(trend) {
  start_ = std::numeric_limits<double>::infinity();
  end_ = -start_;
  for (const DecaySignal& s : signals) {
    if (s.t.empty()) continue;
    start_ = std::min(start_, s.t.front());
    end_ = std::max(end_, s.t.back());
    samples_ += s.t.size();
    weighted_ = weighted_ && s.sigma.size() == s.t.size();
  }
  for (const DecaySignal& s : signals) {
    const auto n = static_cast<Eigen::Index>(s.t.size());
    Eigen::VectorXd w = Eigen::VectorXd::Ones(n);
    if (weighted_) w = Eigen::Map<const Eigen::VectorXd>(s.sigma.data(), n).cwiseInverse();
    weight_.push_back(w);
    value_.push_back(w.cwiseProduct(Eigen::Map<const Eigen::VectorXd>(s.value.data(), n)));
    Eigen::MatrixXd p(n, trend + 1);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double x =
          2.0 * (s.t[static_cast<std::size_t>(i)] - start_) / std::max(end_ - start_, 1e-300) - 1.0;
      double power = w(i);
      for (int d = 0; d <= trend; ++d, power *= x) p(i, d) = power;
    }
    polynomial_.push_back(std::move(p));
  }
}

DecayChannel DecayProblem::Solve(std::size_t j, const Eigen::VectorXd& pole,
                                 bool derivatives) const {
  const DecaySignal& s = signals_[j];
  const auto n = static_cast<Eigen::Index>(s.t.size());
  const Eigen::Index modes = pole.size() / 2;
  DecayChannel out;
  out.basis.resize(n, 2 * modes + trend_ + 1);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double t = s.t[static_cast<std::size_t>(i)] - start_;
    for (Eigen::Index k = 0; k < modes; ++k) {
      const double e = weight_[j](i) * std::exp(-pole(2 * k) * t);
      out.basis(i, 2 * k) = e * std::cos(pole(2 * k + 1) * t);
      out.basis(i, 2 * k + 1) = e * std::sin(pole(2 * k + 1) * t);
    }
  }
  out.basis.rightCols(trend_ + 1) = polynomial_[j];
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(out.basis);
  const Eigen::Index q = out.basis.cols();
  const auto R = qr.matrixQR().topRows(q).triangularView<Eigen::Upper>();
  Eigen::VectorXd y = qr.householderQ().adjoint() * value_[j];
  out.coefficient = R.solve(y.head(q));
  y.head(q).setZero();
  out.residual = qr.householderQ() * y;
  if (!derivatives) return out;
  Eigen::MatrixXd D(n, pole.size());
  for (Eigen::Index i = 0; i < n; ++i) {
    const double t = s.t[static_cast<std::size_t>(i)] - start_;
    for (Eigen::Index k = 0; k < modes; ++k) {
      const double c = out.basis(i, 2 * k), d = out.basis(i, 2 * k + 1);
      const double A = out.coefficient(2 * k), B = out.coefficient(2 * k + 1);
      D(i, 2 * k) = t * (A * c + B * d);  // of the residual: minus the model's
      D(i, 2 * k + 1) = t * (A * d - B * c);
    }
  }
  Eigen::MatrixXd P = qr.householderQ().adjoint() * D;
  out.imitation = R.solve(P.topRows(q));
  P.topRows(q).setZero();
  out.jacobian = qr.householderQ() * P;
  const Eigen::MatrixXd inverse_R = R.solve(Eigen::MatrixXd::Identity(q, q));
  out.inverse = inverse_R * inverse_R.transpose();
  return out;
}

namespace {

double SumOfSquares(const DecayProblem& problem, const Eigen::VectorXd& pole) {
  double sum = 0.0;
  for (std::size_t j = 0; j < problem.channels(); ++j) {
    sum += problem.Solve(j, pole, false).residual.squaredNorm();
  }
  return sum;
}

}  // namespace

bool Minimise(const DecayProblem& problem, int max_iterations, Eigen::VectorXd* pole) {
  constexpr double kSmall = 1e-3;      // of a standard error: nothing a user could see
  constexpr double kRoundOff = 1e-11;  // relative; noise-free signals have no standard error
  constexpr double kGrowth = 5.0;  // e-folds over the record: no free decay grows so, and overflows
  const Eigen::Index unknowns = pole->size();
  double lambda = 1e-3;
  double current = -1.0;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(unknowns, unknowns);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(unknowns);
    double sum = 0.0;
    for (std::size_t j = 0; j < problem.channels(); ++j) {
      const DecayChannel c = problem.Solve(j, *pole, true);
      H.noalias() += c.jacobian.transpose() * c.jacobian;
      g.noalias() += c.jacobian.transpose() * c.residual;
      sum += c.residual.squaredNorm();
    }
    current = sum;
    const Eigen::MatrixXd inverse = H.ldlt().solve(Eigen::MatrixXd::Identity(unknowns, unknowns));
    const double unit =
        problem.weighted() ? 1.0
                           : sum / static_cast<double>(std::max<std::size_t>(1, problem.samples()));
    bool accepted = false;
    for (int attempt = 0; attempt < 12 && !accepted; ++attempt) {
      Eigen::MatrixXd damped = H;
      damped.diagonal() *= 1.0 + lambda;
      const Eigen::VectorXd step = -damped.ldlt().solve(g);
      if (!step.allFinite()) return false;
      const Eigen::VectorXd trial = *pole + step;
      bool bounded = true;
      for (Eigen::Index i = 0; i < unknowns; i += 2) {
        bounded = bounded && trial(i) * problem.duration() > -kGrowth;
      }
      const double next = bounded ? SumOfSquares(problem, trial) : 2.0 * current + 1.0;
      bool small = true;
      for (Eigen::Index i = 0; i < unknowns; ++i) {
        const double sigma = std::sqrt(std::max(0.0, unit * inverse(i, i)));
        const double size = std::hypot((*pole)(i - i % 2), (*pole)(i - i % 2 + 1));
        small = small && std::abs(step(i)) <= std::max(kSmall * sigma, kRoundOff * size);
      }
      if (next <= current) {
        *pole = trial;
        lambda = std::max(1e-12, 0.1 * lambda);
        accepted = true;
      } else {
        lambda *= 10.0;
      }
      if (small) return true;
    }
    if (!accepted) return false;
  }
  return false;
}

}  // namespace unfurl::correlate
