#include "sim/implicit/modes.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include "sim/implicit/linearised.h"

namespace unfurl::sim {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kDenseBodies = 150;  // up to here the dense solution takes a second at most
// Standard deviations of what rounding makes of v^T K v; 9 were seen (beams of 4 segments), mostly
// less than 1.
constexpr double kRoundings = 128.0;
constexpr double kNoStiffness = 1e-250;  // [1/s^2], so that its inverse is a number
constexpr int kGuard = 8;                // vectors of the subspace beyond those wanted
// Of the subspace: an error falls by the ratio of omega^2 to that of the first mode beyond it.
constexpr int kModesMostIterations = 200;
constexpr double kConverged = 1e-10;  // change of omega^2 in an iteration, relative
// Of a motion's rounding: what it may change by and be converged; and, so many of it, from where on
// a motion is taken for one that bends while none is converged yet.
constexpr double kStill = 1e-3, kFarFromRigid = 1e3;
// Of M, what rounding of b K may take.
constexpr double kMostLost = 1e-2;
// Where solutions with this times another b differ by more of omega^2, neither is believed.
constexpr double kOtherB = 0.3, kAgree = 1e-3;
constexpr double kSteady = 0.1;      // in an iteration, where rounding changes all of it
constexpr int kFirstIterations = 5;  // after which softest and stiffer motions are apart
// Of the search for unstable motions: b to the next, where a motion that is just missed at one b
// has the eigenvalue 1 / (1 - 2 / 4) at the next; how soft the stiffest motion is to the last; the
// columns, and the iterations after which a motion that grows has outgrown a thousand others,
// 2^12 / 1000.
constexpr double kFiner = 0.25, kSoft = 0.05;
constexpr int kUnstableColumns = 6, kUnstableIterations = 12;

// Vectors of the unknowns alone.
class Unknowns {
 public:
  explicit Unknowns(Linearised* system)
      : system_(*system), stiffest_(std::max(system->Stiffest(), kNoStiffness)) {}

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
  // Rounding of v^T K v: an omega^2 below it, v^T M v = 1, is not told from none.
  double Rounding(const VectorXd& v) const {
    constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
    return kRoundings * kEpsilon * system_.StiffnessSize(Spread(v).data()) +
           kEpsilon * kEpsilon * stiffest_;  // for what nothing holds
  }
  double stiffest() const { return stiffest_; }
  // For (M + b K)^-1; no b beyond which rounding of b K hides M.
  void Factor(double b) { system_.Factor(std::min(b, MostB())); }
  double MostB() const { return kMostLost / (std::numeric_limits<double>::epsilon() * stiffest_); }
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
  double stiffest_;
};

struct Pairs {
  VectorXd square;  // omega^2, rising
  MatrixXd vector;  // columns, v^T M v = 1
  // A |omega^2| up to this is not told from none, by column.
  VectorXd hidden;
  VectorXd doubt;  // what rounding leaves of omega^2, of itself

  int Told() const { return static_cast<int>((square.array().abs() > hidden.array()).count()); }
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
  return {solver.eigenvalues(), root.matrixU().solve(vectors), {}, {}};
}

// Of each omega^2: motions as soft as each other are mixed, and share theirs.
VectorXd RoundingOf(const Unknowns& of, const VectorXd& square, const MatrixXd& vectors) {
  VectorXd own(square.size()), out = VectorXd::Zero(square.size());
  for (int c = 0; c < own.size(); ++c) own[c] = of.Rounding(vectors.col(c));
  for (int c = 0; c < own.size(); ++c) {
    for (int k = 0; k < own.size(); ++k) {
      if (std::fabs(square[k]) <= std::fabs(square[c])) out[c] = std::max(out[c], own[k]);
    }
  }
  return out;
}

// What is lowest among the motions of some vectors (Rayleigh and Ritz), from K itself.
Pairs Ritz(const Unknowns& of, const MatrixXd& vectors) {
  MatrixXd KV(vectors.rows(), vectors.cols()), MV(vectors.rows(), vectors.cols());
  for (int c = 0; c < vectors.cols(); ++c) {
    KV.col(c) = of.Stiffness(vectors.col(c));
    MV.col(c) = of.Mass(vectors.col(c));
  }
  const MatrixXd A = vectors.transpose() * KV, B = vectors.transpose() * MV;
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> ritz(0.5 * (A + A.transpose()), B);
  Pairs pairs = {ritz.eigenvalues(), vectors * ritz.eigenvectors(), {}, {}};
  pairs.hidden = RoundingOf(of, pairs.square, pairs.vector);
  return pairs;
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

  // One iteration with (M + b K)^-1 M on the constraints, b of the last Factor.
  void Iterate() {
    before_ = square_;
    for (int c = 0; c < X_.cols(); ++c) {
      VectorXd x = of_.Solve(of_.Mass(X_.col(c)));
      if (known_.cols() > 0) x -= known_ * (mass_known_.transpose() * x);
      X_.col(c) = x / std::sqrt(x.dot(of_.Mass(x)));
    }
    Pairs pairs = Ritz(of_, X_);
    X_ = std::move(pairs.vector);
    square_ = std::move(pairs.square);
    rounding_ = std::move(pairs.hidden);
  }
  const MatrixXd& vectors() const { return X_; }
  const VectorXd& square() const { return square_; }      // omega^2, rising
  const VectorXd& rounding() const { return rounding_; }  // of square()
  int Unstable() const {
    int count = 0;
    while (count < square_.size() && square_[count] < -rounding_[count]) ++count;
    return count;
  }
  // Whether the last iteration has left an omega^2 much as it was: what rounding makes changes.
  bool Steady(int k) const {
    return before_.size() > 0 &&
           std::fabs(square_[k] - before_[k]) < kSteady * std::fabs(square_[k]);
  }
  // By how much of themselves the first `count` have changed; nothing where rounding makes it.
  double Change(int count) const {
    if (before_.size() == 0) return 1.0;
    double change = 0.0;
    for (int k = 0; k < count; ++k) {
      const double off = std::fabs(square_[k] - before_[k]);
      if (off > kStill * rounding_[k]) {
        change = std::max(change, off / std::max(std::fabs(square_[k]), rounding_[k]));
      }
    }
    return change;
  }

 private:
  const Unknowns& of_;
  const MatrixXd& known_;
  MatrixXd mass_known_, X_;
  VectorXd square_, before_, rounding_;
};

// Unstable motions, v^T M v = 1. Of (M + b K)^-1 M they have the eigenvalues 1 / (1 + b omega^2),
// which is beyond 1, and so beyond all stable ones, where 0 > b omega^2 > -2: so b is taken from
// what rounding hides to what is stiff. One b alone would leave out what grows much faster than the
// softest stable motion swings.
MatrixXd FindUnstable(Unknowns& of, double rounding) {
  MatrixXd unstable(of.size(), 0);
  for (double b = std::min(1.0 / (kFarFromRigid * rounding), of.MostB()); b * of.stiffest() > kSoft;
       b *= kFiner) {
    of.Factor(b);
    Subspace space(of, std::min(kUnstableColumns, of.free() - static_cast<int>(unstable.cols())),
                   unstable);
    for (int k = 0; k < kModesMostIterations; ++k) {
      space.Iterate();
      if (k < kUnstableIterations) continue;
      if (space.Unstable() == 0 || space.Change(space.Unstable()) < kConverged) break;
    }
    for (int k = 0; k < space.Unstable(); ++k) {
      if (!space.Steady(k)) continue;
      unstable.conservativeResize(Eigen::NoChange, unstable.cols() + 1);
      unstable.col(unstable.cols() - 1) = space.vectors().col(k);
    }
  }
  return unstable;
}

// The least rounding among the softest motions.
double LeastRounding(Unknowns& of, double time_scale) {
  of.Factor(time_scale * time_scale);
  const MatrixXd none(of.size(), 0);
  Subspace space(of, std::min(kGuard, of.free()), none);
  for (int k = 0; k < kFirstIterations; ++k) space.Iterate();
  return space.rounding().minCoeff();
}

// Subspace iteration (Bathe) for the lowest motions beside `unstable` ones: of (M + b K)^-1 M the
// eigenvalues 1 / (1 + b omega^2) are largest, rigid motions included.
Pairs SolveStable(Unknowns& of, int wanted, const MatrixXd& unstable, double time_scale) {
  const int columns = std::min(wanted + kGuard, of.free() - static_cast<int>(unstable.cols()));
  const int counted = std::min(wanted, columns);
  Subspace space(of, columns, unstable);
  // b [s^2]; later 1 / omega^2 of the lowest one that bends.
  of.Factor(time_scale * time_scale);
  for (int iteration = 1; iteration <= kModesMostIterations; ++iteration) {
    space.Iterate();
    if (space.Change(counted) < kConverged) break;
    if (iteration == kFirstIterations) {
      for (int k = 0; k < columns; ++k) {
        if (space.square()[k] < kFarFromRigid * space.rounding()[k] || !space.Steady(k)) continue;
        of.Factor(1.0 / space.square()[k]);
        break;
      }
    }
  }
  // The columns beyond hold what the others have left.
  return {space.square().head(counted), space.vectors().leftCols(counted), {}, {}};
}

// Solved once more with another b: what comes out otherwise was made by rounding, or has not
// converged, and is not believed.
void Repeat(Unknowns& of, Pairs* pairs) {
  double softest = of.stiffest();
  for (int k = 0; k < pairs->square.size(); ++k) {
    const double size = std::fabs(pairs->square[k]);
    if (size > pairs->hidden[k]) softest = std::min(softest, size);
  }
  of.Factor(kOtherB / softest);
  MatrixXd again(pairs->vector.rows(), pairs->vector.cols());
  for (int c = 0; c < again.cols(); ++c) again.col(c) = of.Solve(of.Mass(pairs->vector.col(c)));
  const VectorXd square = Ritz(of, again).square;
  pairs->doubt = VectorXd::Zero(square.size());
  for (int k = 0; k < square.size(); ++k) {
    const double size = std::max(std::fabs(pairs->square[k]), std::fabs(square[k]));
    pairs->doubt[k] = size > 0.0 ? std::fabs(square[k] - pairs->square[k]) / size : 0.0;
    if (pairs->doubt[k] > kAgree) pairs->hidden[k] = std::max(pairs->hidden[k], size);
  }
}

// `wanted` that are not rigid, as far as there are so many; rigid ones beside them.
Pairs SolveSubspace(Unknowns& of, int wanted, double time_scale) {
  constexpr int kMostRigid = 3;  // x, y, theta of one structure; there may be many
  const MatrixXd unstable = FindUnstable(of, LeastRounding(of, time_scale));
  for (int columns = wanted + kMostRigid;; columns *= 2) {
    const Pairs stable = SolveStable(of, columns, unstable, time_scale);
    MatrixXd all(of.size(), unstable.cols() + stable.vector.cols());
    all << unstable, stable.vector;
    Pairs pairs = Ritz(of, all);
    if (pairs.Told() >= wanted || stable.square.size() < columns) return pairs;
  }
}

// The dense solution rounds all of them from the stiffest.
Pairs SolveSmall(const Unknowns& of, int wanted) {
  const Pairs all = SolveDense(of);
  const auto most = static_cast<int>(all.square.size());
  for (int columns = wanted + kGuard;; columns *= 2) {
    Pairs pairs = Ritz(of, all.vector.leftCols(std::min(columns, most)));
    if (pairs.Told() >= wanted || columns >= most) return pairs;
  }
}

}  // namespace

ModesReport FindModes(Dynamics* dynamics, double* y, int count, ModesSolver solver) {
  Linearised system(dynamics);
  system.About(y);
  Unknowns of(&system);
  ModesReport report;
  if (of.free() <= 0) return report;
  const bool dense = solver == ModesSolver::kDense ||
                     (solver == ModesSolver::kAuto && of.size() <= 3 * kDenseBodies);
  Pairs pairs =
      dense ? SolveSmall(of, count) : SolveSubspace(of, count, dynamics->model().time_scale);
  Repeat(of, &pairs);
  double hidden = 0.0;
  const RigidBodies& bodies = dynamics->model().rigid_bodies;
  const int n = bodies.count;
  for (int k = 0; k < pairs.square.size(); ++k) {
    if (static_cast<int>(report.modes.size()) == count) break;
    const double square = pairs.square[k];
    const VectorXd v = pairs.vector.col(k);
    if (std::fabs(square) <= pairs.hidden[k]) {
      ++report.rigid;
      hidden = std::max(hidden, pairs.hidden[k]);
      continue;
    }
    NaturalMode mode;
    report.rounding = std::max(report.rounding, 0.5 * pairs.doubt[k]);
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
  report.rigid_below = std::sqrt(hidden) / (2.0 * M_PI);
  return report;
}

}  // namespace unfurl::sim
