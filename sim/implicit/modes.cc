#include "sim/implicit/modes.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>

#include "sim/implicit/kkt.h"

namespace unfurl::sim {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kDenseBodies = 150;  // up to here the dense solution takes a second at most
constexpr double kRigid = 1e-11;   // of the largest omega^2, below which rounding hides a stiffness
constexpr int kGuard = 8;          // vectors of the subspace beyond those wanted
// Of the subspace: an error falls by the ratio of omega^2 to that of the first mode beyond it.
constexpr int kModesMostIterations = 200;
constexpr double kConverged = 1e-10;  // change of omega^2 in an iteration, relative

class Linearised {
 public:
  Linearised(Dynamics* dynamics, double* y)
      : model_(dynamics->model()), n_(model_.rigid_bodies.count) {
    const Constraints& constraints = model_.constraints;
    std::vector<double> rate(model_.index.size());
    dynamics->RightSide(0.0, y, rate.data());
    const Constraints::Work& work = dynamics->constraint_work();
    const std::vector<double> lambda(work.lambda.begin(), work.lambda.end());
    dynamics->FillTangent(0.0, y, lambda.data(), &tangent_);
    J_.assign(6 * constraints.rows() + 6, 0.0);
    if (constraints.count() > 0) {
      constraints.Jacobian(dynamics->MotionAt(0.0, y), work, J_.data());
    }
    for (int s = 0; s < n_; ++s) {
      if (!model_.rigid_bodies.IsDynamic(s)) continue;
      for (int d = 0; d < 3; ++d) {
        entry_.push_back(d * n_ + s);
        mass_.push_back(d < 2 ? model_.rigid_bodies.mass[s] : model_.rigid_bodies.inertia[s]);
        stiffest_ = std::max(stiffest_, tangent_.K(s)[4 * d] / mass_.back());
      }
    }
  }

  int size() const { return static_cast<int>(entry_.size()); }
  double mass(int k) const { return mass_[k]; }
  double stiffest() const { return stiffest_; }  // an estimate of the largest omega^2
  const Tangent& tangent() const { return tangent_; }
  const double* jacobian() const { return J_.data(); }
  const Model& model() const { return model_; }

  std::vector<double> Spread(const VectorXd& v) const {
    std::vector<double> out(3 * n_ + kBlock, 0.0);
    for (int k = 0; k < size(); ++k) out[entry_[k]] = v[k];
    return out;
  }
  VectorXd Gather(const std::vector<double>& v) const {
    VectorXd out(size());
    for (int k = 0; k < size(); ++k) out[k] = v[entry_[k]];
    return out;
  }
  VectorXd Times(bool damping, const VectorXd& v) const {
    const std::vector<double> in = Spread(v);
    std::vector<double> out(in.size(), 0.0);
    damping ? tangent_.AddDamping(1.0, in.data(), out.data())
            : tangent_.AddStiffness(1.0, in.data(), out.data());
    return Gather(out);
  }
  // Rows of J on the moving entries.
  MatrixXd DenseJacobian() const {
    const Constraints& constraints = model_.constraints;
    std::vector<int> column(3 * n_, -1);
    for (int k = 0; k < size(); ++k) column[entry_[k]] = k;
    MatrixXd out = MatrixXd::Zero(constraints.count(), size());
    int row = 0;
    for (int r = 0; r < constraints.rows(); ++r) {
      if (!constraints.IsActive(r)) continue;
      for (int k = 0; k < 6; ++k) {
        const int body = k < 3 ? constraints.InnerBody(r) : constraints.OuterBody(r);
        const int c = column[k % 3 * n_ + body];
        if (c >= 0) out(row, c) += J_[6 * r + k];
      }
      ++row;
    }
    return out;
  }

 private:
  const Model& model_;
  int n_;
  Tangent tangent_;
  std::vector<double> J_;
  std::vector<int> entry_;  // of the state's position blocks
  std::vector<double> mass_;
  double stiffest_ = 0.0;
};

struct Pairs {
  VectorXd square;  // omega^2, rising
  MatrixXd vector;  // columns, v^T M v = 1
};

// On the null space of J, in coordinates scaled with the roots of the masses.
Pairs SolveDense(const Linearised& system) {
  const int size = system.size();
  VectorXd root(size);
  for (int k = 0; k < size; ++k) root[k] = std::sqrt(system.mass(k));
  MatrixXd K(size, size);
  for (int k = 0; k < size; ++k) {
    K.col(k) = system.Times(false, VectorXd::Unit(size, k) / root[k]).cwiseQuotient(root);
  }
  MatrixXd N = MatrixXd::Identity(size, size);
  const MatrixXd J = system.DenseJacobian() * root.cwiseInverse().asDiagonal();
  if (J.rows() > 0) {
    const Eigen::ColPivHouseholderQR<MatrixXd> qr(J.transpose());
    N = (qr.householderQ() * MatrixXd::Identity(size, size)).rightCols(size - qr.rank());
  }
  const MatrixXd reduced = N.transpose() * K * N;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(0.5 * (reduced + reduced.transpose()));
  return {solver.eigenvalues(), root.cwiseInverse().asDiagonal() * (N * solver.eigenvectors())};
}

// Subspace iteration (Bathe) with (M + b K)^-1 M on the constraints: its eigenvalues are
// 1 / (1 + b omega^2), so the lowest frequencies come out, rigid motions included.
Pairs SolveSubspace(const Linearised& system, int wanted) {
  const int size = system.size(), columns = std::min(wanted + kGuard, size);
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  MatrixXd X(size, columns);
  for (int c = 0; c < columns; ++c) {
    for (int k = 0; k < size; ++k) X(k, c) = normal(random);
  }
  VectorXd mass(size);
  for (int k = 0; k < size; ++k) mass[k] = system.mass(k);
  Saddle saddle(system.model().rigid_bodies, system.model().constraints, system.tangent());
  // [s^2]; later 1 / omega^2 of the lowest one that bends.
  double b = system.model().time_scale * system.model().time_scale;
  saddle.Factor(system.tangent(), system.jacobian(), 0.0, b);
  VectorXd square = VectorXd::Zero(columns);
  for (int iteration = 0; iteration < kModesMostIterations; ++iteration) {
    for (int c = 0; c < columns; ++c) {
      std::vector<double> x = system.Spread(mass.cwiseProduct(X.col(c)));
      saddle.Solve(x.data(), nullptr);
      X.col(c) = system.Gather(x);
      X.col(c) /= std::sqrt(X.col(c).dot(mass.cwiseProduct(X.col(c))));
    }
    MatrixXd KX(size, columns);
    for (int c = 0; c < columns; ++c) KX.col(c) = system.Times(false, X.col(c));
    const MatrixXd A = X.transpose() * KX, B = X.transpose() * mass.asDiagonal() * X;
    const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> ritz(0.5 * (A + A.transpose()), B);
    X = X * ritz.eigenvectors();
    const VectorXd& found = ritz.eigenvalues();
    double change = 0.0;
    const double rigid = kRigid * system.stiffest();
    for (int k = 0; k < std::min(wanted, columns); ++k) {
      change =
          std::max(change, std::fabs(found[k] - square[k]) / std::max(std::fabs(found[k]), rigid));
    }
    square = found;
    if (change < kConverged) break;
    if (iteration == 4) {
      for (int k = 0; k < columns; ++k) {
        if (square[k] < 1e3 * rigid) continue;
        b = 1.0 / square[k];
        saddle.Factor(system.tangent(), system.jacobian(), 0.0, b);
        break;
      }
    }
  }
  return {square, X};
}

}  // namespace

ModesReport FindModes(Dynamics* dynamics, double* y, int count, ModesSolver solver) {
  const Linearised system(dynamics, y);
  ModesReport report;
  if (system.size() == 0) return report;
  const bool dense = solver == ModesSolver::kDense ||
                     (solver == ModesSolver::kAuto && system.size() <= 3 * kDenseBodies);
  constexpr int kMostRigid = 3;  // x, y, theta of one structure; those of others take the guard's
  const Pairs pairs = dense ? SolveDense(system) : SolveSubspace(system, count + kMostRigid);
  const double rigid = kRigid * system.stiffest();
  const int n = system.model().rigid_bodies.count;
  for (int k = 0; k < pairs.square.size(); ++k) {
    if (static_cast<int>(report.modes.size()) == count) break;
    const double square = pairs.square[k];
    if (std::fabs(square) <= rigid) {
      ++report.rigid;
      continue;
    }
    NaturalMode mode;
    const VectorXd v = pairs.vector.col(k);
    if (square < 0.0) {
      mode.growth = std::sqrt(-square);
    } else {
      const double omega = std::sqrt(square);
      mode.frequency = omega / (2.0 * M_PI);
      mode.damping = v.dot(system.Times(true, v)) / (2.0 * omega);  // v^T M v = 1
    }
    mode.shape = system.Spread(v);
    mode.shape.resize(3 * n);
    int at = 0;
    double largest = 0.0, turned = 0.0;
    for (int i = 0; i < 3 * n; ++i) {
      const double size = std::fabs(mode.shape[i]);
      if (i < 2 * n && size > largest) {
        largest = size;
        at = i;
      }
      if (i >= 2 * n) turned = std::max(turned, size);
    }
    const double scale = largest > 1e-9 * turned ? mode.shape[at] : turned;
    for (double& s : mode.shape) s /= scale;
    report.modes.push_back(std::move(mode));
  }
  return report;
}

}  // namespace unfurl::sim
