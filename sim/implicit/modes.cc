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
// Parts of the largest omega^2 below which rounding hides a stiffness: what rounding changes; and,
// so many of them, from where on a motion is taken for one that bends while none is converged yet.
constexpr double kRigidNoise = 1e-3, kFarFromRigid = 1e3;
// Of the search for unstable motions: b to the next, where a motion that is just missed at one b
// has the eigenvalue 1 / (1 - 2 / 4) at the next; how soft the stiffest motion is to the last; the
// columns, and the iterations after which a motion that grows has outgrown a thousand others,
// 2^12 / 1000.
constexpr double kFiner = 0.25, kSoft = 0.05;
constexpr int kUnstableColumns = 6, kUnstableIterations = 12;

// Vectors of the unknowns alone.
class Unknowns {
 public:
  explicit Unknowns(Linearised* system) : system_(*system) {}

  int size() const { return static_cast<int>(system_.entries().size()); }
  // Motions that the constraints leave.
  int free() const { return size() - system_.constraints(); }
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

// A space of trial vectors, and what the lowest motions in it are (Rayleigh and Ritz).
class Subspace {
 public:
  // So many random columns; those of `known`, with v^T M v = 1, are kept out of it.
  Subspace(const Unknowns& of, int columns, const MatrixXd& known)
      : of_(of), known_(known), mass_known_(of.size(), known.cols()), X_(of.size(), columns) {
    for (int c = 0; c < known.cols(); ++c) mass_known_.col(c) = of.Mass(known.col(c));
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    for (int c = 0; c < columns; ++c) {
      for (int k = 0; k < of.size(); ++k) X_(k, c) = normal(random);
    }
  }

  // One iteration with (M + b K)^-1 M on the constraints, b of the last Factor; omega^2, rising.
  VectorXd Iterate() {
    const int columns = static_cast<int>(X_.cols());
    MatrixXd KX(X_.rows(), columns), MX(X_.rows(), columns);
    for (int c = 0; c < columns; ++c) {
      VectorXd x = of_.Solve(of_.Mass(X_.col(c)));
      if (known_.cols() > 0) x -= known_ * (mass_known_.transpose() * x);
      X_.col(c) = x / std::sqrt(x.dot(of_.Mass(x)));
      MX.col(c) = of_.Mass(X_.col(c));
      KX.col(c) = of_.Stiffness(X_.col(c));
    }
    const MatrixXd A = X_.transpose() * KX, B = X_.transpose() * MX;
    const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> ritz(0.5 * (A + A.transpose()), B);
    X_ = X_ * ritz.eigenvectors();
    return ritz.eigenvalues();
  }
  const MatrixXd& vectors() const { return X_; }

 private:
  const Unknowns& of_;
  const MatrixXd& known_;
  MatrixXd mass_known_, X_;
};

// By how much of itself omega^2 has changed; nothing where rounding makes it.
double LargestChange(const VectorXd& found, const VectorXd& before, int count, double rigid) {
  double change = 0.0;
  for (int k = 0; k < count; ++k) {
    const double size = std::fabs(found[k]), off = std::fabs(found[k] - before[k]);
    if (off > kRigidNoise * rigid) change = std::max(change, off / std::max(size, rigid));
  }
  return change;
}

// Unstable motions, v^T M v = 1. Of (M + b K)^-1 M they have the eigenvalues 1 / (1 + b omega^2),
// which is beyond 1, and so beyond all stable ones, where 0 > b omega^2 > -2: so b is taken from
// what rounding hides to what is stiff. One b alone would leave out what grows much faster than the
// softest stable motion swings.
MatrixXd FindUnstable(const Unknowns& of, double rigid, double stiffest) {
  MatrixXd unstable(of.size(), 0);
  for (double b = 1.0 / (kFarFromRigid * rigid); b * stiffest > kSoft; b *= kFiner) {
    of.system().Factor(b);
    Subspace space(of, std::min(kUnstableColumns, of.free() - static_cast<int>(unstable.cols())),
                   unstable);
    VectorXd square, before;
    double change = 1.0;
    for (int k = 0; k < kModesMostIterations && change > kConverged; ++k) {
      before = square;
      square = space.Iterate();
      if (k < kUnstableIterations) continue;
      if (square[0] > -rigid) break;
      const auto count = static_cast<int>((square.array() < -rigid).count());
      change = LargestChange(square, before, count, rigid);
    }
    for (int k = 0; k < square.size() && square[k] < -rigid; ++k) {
      unstable.conservativeResize(Eigen::NoChange, unstable.cols() + 1);
      unstable.col(unstable.cols() - 1) = space.vectors().col(k);
    }
  }
  return unstable;
}

// Subspace iteration (Bathe) for the lowest motions beside `unstable` ones: of (M + b K)^-1 M the
// eigenvalues 1 / (1 + b omega^2) are largest, rigid motions included.
Pairs SolveStable(const Unknowns& of, int wanted, const MatrixXd& unstable, double time_scale,
                  double rigid) {
  const int columns = std::min(wanted + kGuard, of.free() - static_cast<int>(unstable.cols()));
  const int counted = std::min(wanted, columns);
  Subspace space(of, columns, unstable);
  // [s^2]; later 1 / omega^2 of the lowest one that bends.
  double b = time_scale * time_scale;
  of.system().Factor(b);
  VectorXd square = VectorXd::Zero(columns);
  for (int iteration = 0; iteration < kModesMostIterations; ++iteration) {
    const VectorXd before = square;
    square = space.Iterate();
    if (LargestChange(square, before, counted, rigid) < kConverged) break;
    if (iteration == 4) {
      for (int k = 0; k < columns; ++k) {
        if (square[k] < kFarFromRigid * rigid) continue;
        b = 1.0 / square[k];
        of.system().Factor(b);
        break;
      }
    }
  }
  // The columns beyond hold what the others have left.
  return {square.head(counted), space.vectors().leftCols(counted)};
}

// `wanted` that are not rigid, as far as there are so many; rigid ones beside them.
Pairs SolveSubspace(const Unknowns& of, int wanted, double time_scale, double rigid,
                    double stiffest) {
  constexpr int kMostRigid = 3;  // x, y, theta of one structure; there may be many
  const MatrixXd unstable = FindUnstable(of, rigid, stiffest);
  const auto grow = static_cast<int>(unstable.cols());
  Pairs pairs;
  for (int columns = wanted + kMostRigid;; columns *= 2) {
    pairs = SolveStable(of, columns, unstable, time_scale, rigid);
    const auto bend = static_cast<int>((pairs.square.array().abs() > rigid).count());
    if (grow + bend >= wanted || pairs.square.size() < columns) break;
  }
  const int count = grow + static_cast<int>(pairs.square.size());
  MatrixXd all(of.size(), count), K_all(of.size(), count), M_all(of.size(), count);
  all << unstable, pairs.vector;
  for (int c = 0; c < count; ++c) {
    K_all.col(c) = of.Stiffness(all.col(c));
    M_all.col(c) = of.Mass(all.col(c));
  }
  const MatrixXd A = all.transpose() * K_all, B = all.transpose() * M_all;
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> ritz(0.5 * (A + A.transpose()), B);
  return {ritz.eigenvalues(), all * ritz.eigenvectors()};
}

}  // namespace

ModesReport FindModes(Dynamics* dynamics, double* y, int count, ModesSolver solver) {
  Linearised system(dynamics);
  system.About(y);
  const Unknowns of(&system);
  ModesReport report;
  if (of.free() <= 0) return report;
  const bool dense = solver == ModesSolver::kDense ||
                     (solver == ModesSolver::kAuto && of.size() <= 3 * kDenseBodies);
  const double stiffest = system.Stiffest(), rigid = kRigid * stiffest;
  const Pairs pairs = dense
                          ? SolveDense(of)
                          : SolveSubspace(of, count, dynamics->model().time_scale, rigid, stiffest);
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
