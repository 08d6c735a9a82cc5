#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "correlate/modes/decay_fit.h"

namespace unfurl::correlate {

// One signal at given poles: the best amplitudes, what is left, and the derivatives of what is left
// by decay and frequency of each mode, all in units of sigma.
struct DecayChannel {
  Eigen::MatrixXd basis;        // n x q: cos and sin part of each mode, then the trend
  Eigen::VectorXd coefficient;  // q
  Eigen::VectorXd residual;     // n
  Eigen::MatrixXd jacobian;     // n x 2K, projected on what the amplitudes cannot imitate
  Eigen::MatrixXd imitation;    // q x 2K: change of the amplitudes with the poles
  Eigen::MatrixXd inverse;      // q x q: covariance of the amplitudes at fixed poles, unit noise
};

// The signals over their sigmas, with their trends' columns, as functions of the poles: (a, w) of
// each mode, s = -a + i w.
class DecayProblem {
 public:
  DecayProblem(std::span<const DecaySignal> signals, int trend);

  double start() const { return start_; }
  double duration() const { return end_ - start_; }
  std::size_t samples() const { return samples_; }
  bool weighted() const { return weighted_; }
  std::size_t channels() const { return signals_.size(); }
  const DecaySignal& signal(std::size_t j) const { return signals_[j]; }
  const Eigen::VectorXd& weight(std::size_t j) const { return weight_[j]; }
  const Eigen::VectorXd& value(std::size_t j) const { return value_[j]; }
  const Eigen::MatrixXd& polynomial(std::size_t j) const { return polynomial_[j]; }

  DecayChannel Solve(std::size_t j, const Eigen::VectorXd& pole) const;

  /// Squares left by all signals, and by the poles their gradient and Gauss and Newton's Hessian,
  /// each over two.
  struct Sums {
    double squares = 0.0;
    Eigen::VectorXd gradient;
    Eigen::MatrixXd hessian;
  };
  Sums SumsAt(const Eigen::VectorXd& pole, bool derivatives) const;

 private:
  // n x q: cos and sin part of each mode, then the trend; of signal j.
  Eigen::MatrixXd Basis(std::size_t j, const Eigen::VectorXd& pole) const;
  // Its derivatives by (a, w) of each mode: times (A, B) of a signal they are those of the model.
  Eigen::MatrixXd Slopes(std::size_t j, const Eigen::MatrixXd& basis) const;
  // Whether two signals have the same stamps, and sigmas that a factor makes the same.
  bool Alike(std::size_t i, std::size_t j) const;

  std::span<const DecaySignal> signals_;
  int trend_;
  double start_ = 0.0, end_ = 0.0;
  std::size_t samples_ = 0;
  bool weighted_ = true;
  std::vector<Eigen::VectorXd> weight_, value_;
  std::vector<Eigen::MatrixXd> polynomial_;
  // Signals by what their bases span: all marks of a video, both coordinates of a strobed one.
  std::vector<std::vector<std::size_t>> alike_;
};

// Levenberg and Marquardt on (a, w) of each mode. True when the last step was below a thousandth of
// the unknowns' own standard errors, or of what round-off lets be known.
bool Minimise(const DecayProblem& problem, int max_iterations, Eigen::VectorXd* pole);

}  // namespace unfurl::correlate
