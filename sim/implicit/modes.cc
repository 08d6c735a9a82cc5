#include "sim/implicit/modes.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>

#include "sim/implicit/linearised.h"

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

// Vectors of the unknowns alone.
class Unknowns {
 public:
  explicit Unknowns(Linearised* system) : system_(*system) {}

  int size() const { return static_cast<int>(system_.entries().size()); }
  std::vector<double> Spread(const VectorXd& v) const {
    std::vector<double> out(system_.length(), 0.0);
    for (int k = 0; k < size(); ++k) out[system_.entries()[k]] = v[k];
    system_.Fill(out.data());
    return out;
  }
  VectorXd Gather(const std::vector<double>& v) const {
    VectorXd out(size());
    for (int k = 0; k < size(); ++k) out[k] = v[system_.entries()[k]];
    return out;
  }
  VectorXd Mass(const VectorXd& v) const {
    std::vector<double> w = Spread(v);
    system_.MassTimes(w.data());
    return Gather(w);
  }
  VectorXd Stiffness(const VectorXd& v) const {
    std::vector<double> w(system_.length(), 0.0);
    system_.AddStiffness(Spread(v).data(), w.data());
    return Gather(w);
  }
  VectorXd Damping(const VectorXd& v) const {
    std::vector<double> w(system_.length(), 0.0);
    system_.AddDamping(Spread(v).data(), w.data());
    return Gather(w);
  }
  VectorXd Jacobian(const VectorXd& v) const {
    VectorXd g(system_.rows());
    system_.JacobianTimes(Spread(v).data(), g.data());
    return g;
  }
  // (M + b K)^-1 on the constraints, b of the last Factor.
  VectorXd Solve(const VectorXd& r) const {
    std::vector<double> x(system_.length(), 0.0);
    for (int k = 0; k < size(); ++k) x[system_.entries()[k]] = r[k];
    system_.Solve(x.data(), nullptr);
    return Gather(x);
  }
  Linearised& system() const { return system_; }

 private:
  Linearised& system_;
};

struct Pairs {
  VectorXd square;  // omega^2, rising
  MatrixXd vector;  // columns, v^T M v = 1
};

// On the null space of J, in coordinates of which M is the unit matrix.
Pairs SolveDense(const Unknowns& of) {
  const int size = of.size();
  MatrixXd M(size, size), K(size, size), J(of.system().rows(), size);
  for (int k = 0; k < size; ++k) {
    const VectorXd unit = VectorXd::Unit(size, k);
    M.col(k) = of.Mass(unit);
    K.col(k) = of.Stiffness(unit);
    if (J.rows() > 0) J.col(k) = of.Jacobian(unit);
  }
  const Eigen::LLT<MatrixXd> root(M);
  const auto L = root.matrixL();
  const MatrixXd half = L.solve(K).transpose();
  const MatrixXd scaled = L.solve(half);
  MatrixXd N = MatrixXd::Identity(size, size);
  if (J.rows() > 0) {
    const MatrixXd across = L.solve(J.transpose());
    const Eigen::ColPivHouseholderQR<MatrixXd> qr(across);
    N = (qr.householderQ() * MatrixXd::Identity(size, size)).rightCols(size - qr.rank());
  }
  const MatrixXd reduced = N.transpose() * scaled * N;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(0.5 * (reduced + reduced.transpose()));
  const MatrixXd vectors = N * solver.eigenvectors();
  return {solver.eigenvalues(), root.matrixU().solve(vectors)};
}

// Subspace iteration (Bathe) with (M + b K)^-1 M on the constraints: its eigenvalues are
// 1 / (1 + b omega^2), so the lowest frequencies come out, rigid motions included.
Pairs SolveSubspace(const Unknowns& of, int wanted, double time_scale, double rigid) {
  const int size = of.size(), columns = std::min(wanted + kGuard, size);
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  MatrixXd X(size, columns);
  for (int c = 0; c < columns; ++c) {
    for (int k = 0; k < size; ++k) X(k, c) = normal(random);
  }
  // [s^2]; later 1 / omega^2 of the lowest one that bends.
  double b = time_scale * time_scale;
  of.system().Factor(b);
  VectorXd square = VectorXd::Zero(columns);
  for (int iteration = 0; iteration < kModesMostIterations; ++iteration) {
    MatrixXd KX(size, columns), MX(size, columns);
    for (int c = 0; c < columns; ++c) {
      X.col(c) = of.Solve(of.Mass(X.col(c)));
      X.col(c) /= std::sqrt(X.col(c).dot(of.Mass(X.col(c))));
      MX.col(c) = of.Mass(X.col(c));
      KX.col(c) = of.Stiffness(X.col(c));
    }
    const MatrixXd A = X.transpose() * KX, B = X.transpose() * MX;
    const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> ritz(0.5 * (A + A.transpose()), B);
    X = X * ritz.eigenvectors();
    const VectorXd& found = ritz.eigenvalues();
    double change = 0.0;
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
        of.system().Factor(b);
        break;
      }
    }
  }
  return {square, X};
}

}  // namespace

ModesReport FindModes(Dynamics* dynamics, double* y, int count, ModesSolver solver) {
  Linearised system(dynamics);
  system.About(y);
  const Unknowns of(&system);
  ModesReport report;
  if (of.size() == 0) return report;
  const bool dense = solver == ModesSolver::kDense ||
                     (solver == ModesSolver::kAuto && of.size() <= 3 * kDenseBodies);
  constexpr int kMostRigid = 3;  // x, y, theta of one structure; those of others take the guard's
  const double rigid = kRigid * system.Stiffest();
  const Pairs pairs =
      dense ? SolveDense(of)
            : SolveSubspace(of, count + kMostRigid, dynamics->model().time_scale, rigid);
  report.rigid_below = std::sqrt(rigid) / (2.0 * M_PI);
  const RigidBodies& bodies = dynamics->model().rigid_bodies;
  const int n = bodies.count;
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
      mode.damping = v.dot(of.Damping(v)) / (2.0 * omega);  // v^T M v = 1
    }
    mode.shape = of.Spread(v);
    mode.shape.resize(3 * n);
    int at = 0;
    double largest = 0.0, turned = 0.0;
    for (int i = 0; i < 3 * n; ++i) {
      if (std::binary_search(bodies.amplitudes.begin(), bodies.amplitudes.end(), i % n)) continue;
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
