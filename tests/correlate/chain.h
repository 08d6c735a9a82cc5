#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <string>
#include <unsupported/Eigen/MatrixFunctions>
#include <vector>

#include "base/random.h"
#include "correlate/modes/decay_fit.h"

namespace unfurl::correlate {

// A structure of given modes that independent forces of noise drive, sampled without error: the
// state's exact transition and the exact covariance of what each step adds [Van Loan 1978].
class DrivenStructure {
 public:
  // What is measured of each coordinate.
  enum class Output { kPlace, kRate, kAcceleration };

  // M = I; shapes in the columns, orthonormal; frequencies [Hz], damping ratios.
  DrivenStructure(Eigen::MatrixXd shapes, std::vector<double> frequency,
                  std::vector<double> damping)
      : shapes_(std::move(shapes)),
        frequency_(std::move(frequency)),
        damping_(std::move(damping)) {}

  // n equal masses between equal springs, one end fixed: w_k = w_0 sin((2k - 1) pi / (4n + 2)), the
  // shapes are sin((2k - 1) j pi / (2n + 1)).
  static DrivenStructure Chain(int n, double first, double damping) {
    Eigen::MatrixXd shapes(n, n);
    std::vector<double> f;
    for (int k = 1; k <= n; ++k) {
      const double turn = (2 * k - 1) * std::numbers::pi / (2 * n + 1);
      for (int j = 1; j <= n; ++j) shapes(j - 1, k - 1) = std::sin(turn * j);
      shapes.col(k - 1).normalize();
      f.push_back(std::sin(0.5 * turn) / std::sin(0.5 * std::numbers::pi / (2 * n + 1)) * first);
    }
    return {shapes, f, std::vector<double>(f.size(), damping)};
  }

  const std::vector<double>& frequency() const { return frequency_; }
  const std::vector<double>& damping() const { return damping_; }
  const Eigen::MatrixXd& shapes() const { return shapes_; }

  // `noise`: white, over each signal's own RMS. `corner` > 0: the forces are noise behind a low
  // pass of first order there [Hz].
  std::vector<DecaySignal> Draw(Rng& rng, double step, int samples,
                                const std::vector<int>& coordinates, Output output, double noise,
                                double corner = 0.0) const {
    const Eigen::Index d = shapes_.rows(), n = corner > 0.0 ? 3 * d : 2 * d;
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, n), Q = A;
    A.block(0, d, d, d).setIdentity();
    for (Eigen::Index k = 0; k < d; ++k) {
      const double w = 2.0 * std::numbers::pi * frequency_[static_cast<std::size_t>(k)];
      const Eigen::MatrixXd own = shapes_.col(k) * shapes_.col(k).transpose();
      A.block(d, 0, d, d) -= w * w * own;
      A.block(d, d, d, d) -= 2.0 * damping_[static_cast<std::size_t>(k)] * w * own;
    }
    const Eigen::Index driven = corner > 0.0 ? 2 * d : d;
    Q.block(driven, driven, d, d).setIdentity();
    if (corner > 0.0) {
      A.block(d, 2 * d, d, d).setIdentity();
      A.block(2 * d, 2 * d, d, d) -=
          2.0 * std::numbers::pi * corner * Eigen::MatrixXd::Identity(d, d);
    }
    Eigen::MatrixXd F = Eigen::MatrixXd::Zero(2 * n, 2 * n);
    F.topLeftCorner(n, n) = -A;
    F.topRightCorner(n, n) = Q;
    F.bottomRightCorner(n, n) = A.transpose();
    const Eigen::MatrixXd E = (F * step).exp();
    const Eigen::MatrixXd Ad = E.bottomRightCorner(n, n).transpose();
    const Eigen::MatrixXd added = Ad * E.topRightCorner(n, n);
    // Stationary from the start: the sum over all steps before, doubled again and again.
    Eigen::MatrixXd P = added, power = Ad;
    for (int i = 0; i < 40; ++i, power = (power * power).eval()) P += power * P * power.transpose();
    const Eigen::MatrixXd root = Root(added);
    Eigen::VectorXd x = Root(P) * Normal(rng, n);
    std::vector<DecaySignal> out(coordinates.size());
    for (std::size_t j = 0; j < out.size(); ++j) out[j].name = "y" + std::to_string(j + 1);
    const Eigen::Index first = output == Output::kPlace ? 0 : d;
    for (int i = 0; i < samples; ++i) {
      const Eigen::VectorXd y = output == Output::kAcceleration ? (A * x).eval() : x;
      for (std::size_t j = 0; j < out.size(); ++j) {
        out[j].t.push_back(i * step);
        out[j].value.push_back(y(first + coordinates[j]));
      }
      x = Ad * x + root * Normal(rng, n);
    }
    for (DecaySignal& s : out) {
      const double rms = RmsOf(s);
      for (double& v : s.value) v += noise * rms * rng.Normal();
    }
    return out;
  }

  static double RmsOf(const DecaySignal& s) {
    double squares = 0.0;
    for (const double v : s.value) squares += v * v;
    return std::sqrt(squares / static_cast<double>(s.value.size()));
  }

 private:
  static Eigen::MatrixXd Root(const Eigen::MatrixXd& P) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> e(0.5 * (P + P.transpose()));
    return e.eigenvectors() * e.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  }
  static Eigen::VectorXd Normal(Rng& rng, Eigen::Index n) {
    Eigen::VectorXd out(n);
    for (double& v : out) v = rng.Normal();
    return out;
  }

  Eigen::MatrixXd shapes_;
  std::vector<double> frequency_, damping_;
};

}  // namespace unfurl::correlate
