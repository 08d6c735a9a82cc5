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
  for (std::size_t j = 0; j < signals.size(); ++j) {
    const auto group = std::find_if(alike_.begin(), alike_.end(),
                                    [&](const auto& g) { return Alike(g.front(), j); });
    if (group == alike_.end()) {
      alike_.push_back({j});
    } else {
      group->push_back(j);
    }
  }
}

bool DecayProblem::Alike(std::size_t i, std::size_t j) const {
  constexpr double kRoundOff = 1e-12;  // of quotients and products
  if (signals_[i].t != signals_[j].t || signals_[i].t.empty()) return false;
  const double factor = weight_[j](0) / weight_[i](0);
  return (weight_[j] - factor * weight_[i]).cwiseAbs().maxCoeff() <=
         kRoundOff * weight_[j].cwiseAbs().maxCoeff();
}

Eigen::MatrixXd DecayProblem::Basis(std::size_t j, const Eigen::VectorXd& pole) const {
  const DecaySignal& s = signals_[j];
  const auto n = static_cast<Eigen::Index>(s.t.size());
  const Eigen::Index modes = pole.size() / 2;
  Eigen::MatrixXd basis(n, 2 * modes + trend_ + 1);
  for (Eigen::Index k = 0; k < modes; ++k) {
    for (Eigen::Index i = 0; i < n; ++i) {
      const double t = s.t[static_cast<std::size_t>(i)] - start_;
      const double e = weight_[j](i) * std::exp(-pole(2 * k) * t);
      basis(i, 2 * k) = e * std::cos(pole(2 * k + 1) * t);
      basis(i, 2 * k + 1) = e * std::sin(pole(2 * k + 1) * t);
    }
  }
  basis.rightCols(trend_ + 1) = polynomial_[j];
  return basis;
}

Eigen::MatrixXd DecayProblem::Slopes(std::size_t j, const Eigen::MatrixXd& basis) const {
  const DecaySignal& s = signals_[j];
  const Eigen::Index modal = basis.cols() - trend_ - 1;
  Eigen::ArrayXd t = Eigen::Map<const Eigen::ArrayXd>(s.t.data(), basis.rows()) - start_;
  return basis.leftCols(modal).array().colwise() * t;
}

DecayChannel DecayProblem::Solve(std::size_t j, const Eigen::VectorXd& pole) const {
  DecayChannel out;
  out.basis = Basis(j, pole);
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(out.basis);
  const Eigen::Index q = out.basis.cols();
  const auto R = qr.matrixQR().topRows(q).triangularView<Eigen::Upper>();
  Eigen::VectorXd y = qr.householderQ().adjoint() * value_[j];
  out.coefficient = R.solve(y.head(q));
  y.head(q).setZero();
  out.residual = qr.householderQ() * y;
  const Eigen::MatrixXd slopes = Slopes(j, out.basis);
  Eigen::MatrixXd D(slopes.rows(), pole.size());
  for (Eigen::Index k = 0; k < pole.size(); k += 2) {
    const double A = out.coefficient(k), B = out.coefficient(k + 1);
    D.col(k) = A * slopes.col(k) + B * slopes.col(k + 1);  // of the residual: minus the model's
    D.col(k + 1) = A * slopes.col(k + 1) - B * slopes.col(k);
  }
  Eigen::MatrixXd P = qr.householderQ().adjoint() * D;
  out.imitation = R.solve(P.topRows(q));
  P.topRows(q).setZero();
  out.jacobian = qr.householderQ() * P;
  const Eigen::MatrixXd inverse_R = R.solve(Eigen::MatrixXd::Identity(q, q));
  out.inverse = inverse_R * inverse_R.transpose();
  return out;
}

DecayProblem::Sums DecayProblem::SumsAt(const Eigen::VectorXd& pole, bool derivatives) const {
  const Eigen::Index unknowns = pole.size();
  Sums out;
  out.gradient.setZero(unknowns);
  out.hessian.setZero(unknowns, unknowns);
  for (const std::vector<std::size_t>& group : alike_) {
    const Eigen::MatrixXd basis = Basis(group.front(), pole);
    const Eigen::Index q = basis.cols();
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(basis);
    const Eigen::MatrixXd Q = qr.householderQ() * Eigen::MatrixXd::Identity(basis.rows(), q);
    const auto R = qr.matrixQR().topRows(q).triangularView<Eigen::Upper>();
    Eigen::MatrixXd slopes, products;
    if (derivatives) {
      slopes = Slopes(group.front(), basis);
      const Eigen::MatrixXd imitated = Q.transpose() * slopes;
      slopes.noalias() -= Q * imitated;
      products = slopes.transpose() * slopes;
    }
    for (const std::size_t j : group) {
      const Eigen::VectorXd along = Q.transpose() * value_[j];
      const Eigen::VectorXd residual = value_[j] - Q * along;
      out.squares += residual.squaredNorm();
      if (!derivatives) continue;
      // A factor on the signal's weights is in its amplitudes.
      const Eigen::VectorXd amplitude = R.solve(along);
      Eigen::MatrixXd mix = Eigen::MatrixXd::Zero(unknowns, unknowns);
      for (Eigen::Index k = 0; k < unknowns; k += 2) {
        const double A = amplitude(k), B = amplitude(k + 1);
        mix.block<2, 2>(k, k) << A, -B, B, A;
      }
      const Eigen::VectorXd pull = slopes.transpose() * residual;
      const Eigen::MatrixXd bent = products * mix;
      out.gradient += mix.transpose() * pull;
      out.hessian += mix.transpose() * bent;
    }
  }
  return out;
}

bool Minimise(const DecayProblem& problem, int max_iterations, Eigen::VectorXd* pole) {
  constexpr double kSmall = 1e-3;      // of a standard error: nothing a user could see
  constexpr double kRoundOff = 1e-11;  // relative; noise-free signals have no standard error
  constexpr double kGrowth = 5.0;  // e-folds over the record: no free decay grows so, and overflows
  const Eigen::Index unknowns = pole->size();
  double lambda = 1e-3;
  double current = -1.0;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const DecayProblem::Sums sums = problem.SumsAt(*pole, true);
    const Eigen::MatrixXd& H = sums.hessian;
    const Eigen::VectorXd& g = sums.gradient;
    const double sum = sums.squares;
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
      const double next = bounded ? problem.SumsAt(trial, false).squares : 2.0 * current + 1.0;
      bool small = true;
      for (Eigen::Index i = 0; i < unknowns; ++i) {
        const double sigma = std::sqrt(std::max(unit * inverse(i, i), 0.0));
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
