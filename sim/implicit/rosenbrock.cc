#include "sim/implicit/rosenbrock.h"

#include <algorithm>

namespace unfurl::sim {
namespace {

// Explicit steps are mostly short for stability's sake and then far better than asked. Implicit
// ones are as long as the error allows, and err the same way step after step: a tenth of the
// tolerance for each keeps the sum, and the energy, within it.
constexpr double kStrictness = 10.0;

// Tangent, factorization and four solves, in right sides: 1.9 + 3.5 + 4 x 0.7 by blocks, 1.9 + 7 +
// 4 x 2.9 by entries (docs/decisions/012-implicit.md).
constexpr double kOverheadBlocks = 8.2, kOverheadEntries = 20.5;
// The same with smooth beams, whose right sides are dear: a wing of four takes 13 us a step beside
// right sides of 3.3 us.
constexpr double kOverheadSmooth = 4.0;

}  // namespace

const RosenbrockTable& Ros34Pw2() {
  static const RosenbrockTable table = [] {
    RosenbrockTable t;
    t.name = "Rosenbrock-W method ROS34PW2, third order";
    t.stages = 4;
    t.error_order = 3;
    t.gamma = 4.3586652150845900e-01;
    t.alpha[1][0] = 8.7173304301691801e-01;
    t.alpha[2][0] = 8.4457060015369423e-01;
    t.alpha[2][1] = -1.1299064236484185e-01;
    t.alpha[3][2] = 1.0;
    t.coupling[1][0] = -8.7173304301691801e-01;
    t.coupling[2][0] = -9.0338057013044082e-01;
    t.coupling[2][1] = 5.4180672388095326e-02;
    t.coupling[3][0] = 2.4212380706095346e-01;
    t.coupling[3][1] = -1.2232505839045147e+00;
    t.coupling[3][2] = 5.4526025533510214e-01;
    const double b[] = {2.4212380706095346e-01, -1.2232505839045147e+00, 1.5452602553351020e+00,
                        4.3586652150845900e-01};
    const double b_hat[] = {3.7810903145819369e-01, -9.6042292212423178e-02, 0.5,
                            2.1793326075422950e-01};
    std::copy_n(b, 4, t.b);
    std::copy_n(b_hat, 4, t.b_hat);
    return t;
  }();
  return table;
}

Rosenbrock::Rosenbrock(Dynamics& dynamics, const ErrorScale& scale, const RosenbrockTable& table)
    : Stepper(dynamics, scale), table_(table) {
  // Rows of Gamma^-1 by forward substitution; then a = alpha Gamma^-1, c = 1/gamma - Gamma^-1.
  constexpr int kMost = RosenbrockTable::kMostStages;
  const int s = table.stages;
  double inverse[kMost][kMost] = {};
  for (int i = 0; i < s; ++i) {
    inverse[i][i] = 1.0 / table.gamma;
    for (int j = 0; j < i; ++j) {
      double sum = 0.0;
      for (int k = j; k < i; ++k) sum += table.coupling[i][k] * inverse[k][j];
      inverse[i][j] = -sum / table.gamma;
    }
  }
  for (int i = 0; i < s; ++i) {
    for (int j = 0; j < i; ++j) {
      for (int k = j; k < i; ++k) a_[i][j] += table.alpha[i][k] * inverse[k][j];
      c_[i][j] = -inverse[i][j];
      at_[i] += table.alpha[i][j];
    }
    for (int j = 0; j <= i; ++j) {
      m_[j] += table.b[i] * inverse[i][j];
      e_[j] += (table.b[i] - table.b_hat[i]) * inverse[i][j];
    }
  }
  u_.assign(s, Array(size_, 0.0));
  f0_ = f1_ = rate_ = Array(size_, 0.0);
  solution_ = Array(3 * n_ + kBlock, 0.0);
  const Constraints& constraints = dynamics.model().constraints;
  row_ = lambda_ = end_lambda_ = Array(constraints.rows() + kBlock, 0.0);
  // A first right side, so that the tangent's pattern can be noted.
  stage_.assign(dynamics.model().initial_state.begin(), dynamics.model().initial_state.end());
  dynamics_.RightSide(0.0, stage_.data(), f0_.data());
  dynamics_.FillTangent(0.0, stage_.data(), lambda_.data(), &tangent_);
  const Model& model = dynamics.model();
  if (model.kirchhoff.count() > 0) {
    smooth_ =
        std::make_unique<SmoothSaddle>(model.rigid_bodies, model.kirchhoff, constraints, tangent_);
  } else {
    saddle_ = std::make_unique<Saddle>(model.rigid_bodies, constraints, tangent_);
  }
  jacobian_ = Array(6 * constraints.rows() + kBlock, 0.0);
}

double Rosenbrock::Strictness() const { return kStrictness; }

double Rosenbrock::StepOverhead() const {
  if (smooth_) return kOverheadSmooth;
  return saddle_->by_blocks() ? kOverheadBlocks : kOverheadEntries;
}

void Rosenbrock::Refresh() {
  dynamics_.RightSide(t_, y_.data(), f0_.data());
  ++evaluations_;
  KeepMultipliers(&lambda_);
  linearised_ = false;
}

void Rosenbrock::KeepMultipliers(Array* to) const {
  std::copy_n(dynamics_.constraint_work().lambda.begin(), dynamics_.model().constraints.rows(),
              to->begin());
}

// At the state of the last Refresh, before any stage.
void Rosenbrock::Linearise() {
  dynamics_.FillTangent(t_, y_.data(), lambda_.data(), &tangent_);
  dynamics_.model().constraints.Jacobian(dynamics_.MotionAt(t_, y_.data()),
                                         dynamics_.constraint_work(), jacobian_.data());
  if (smooth_) {
    smooth_->Linearise(dynamics_.model().kirchhoff, dynamics_.constraint_work().smooth_work);
  }
  linearised_ = true;
  factored_h_ = 0.0;
}

// w := M w + h gamma D v and, before, g = J w; of smooth beams with what is attached to them.
void Rosenbrock::FormRight(double hg, double* v, double* w) {
  const bool constrained = dynamics_.model().constraints.count() > 0;
  if (smooth_) {
    smooth_->FillAttached(v);
    smooth_->FillAttached(w);
    if (constrained) smooth_->JacobianTimes(jacobian_.data(), w, row_.data());
    smooth_->MassTimes(w);
    smooth_->AddDamping(tangent_, hg, v, w);
    return;
  }
  if (constrained) saddle_->JacobianTimes(jacobian_.data(), w, row_.data());
  const double* __restrict mass = dynamics_.model().rigid_bodies.mass.data();
  const double* __restrict inertia = dynamics_.model().rigid_bodies.inertia.data();
#pragma GCC ivdep
  for (int k = 0; k < n_; ++k) {
    w[k] *= mass[k];
    w[n_ + k] *= mass[k];
    w[2 * n_ + k] *= inertia[k];
  }
  tangent_.AddDamping(hg, v, w);
}

// Solves for u_i with the rates of the stage in rate_. With F = f + sum c_ij u_j / h and
// z = h gamma F_v + F_q, the increments are u_q = h gamma w, u_v = w - F_q, where
//   W w - J^T mu = M z + h gamma D F_q,   J w = J z.
void Rosenbrock::Stage(int i, double h) {
  const double hg = h * table_.gamma;
  const int n3 = 3 * n_;
  double* __restrict F = rate_.data();
  for (int j = 0; j < i; ++j) {
    const double factor = c_[i][j] / h;
    if (factor == 0.0) continue;
    const double* __restrict u = u_[j].data();
#pragma GCC ivdep
    for (int k = 0; k < size_; ++k) F[k] += factor * u[k];
  }
  double* __restrict w = solution_.data();
  double* __restrict out = u_[i].data();
#pragma GCC ivdep
  for (int k = 0; k < n3; ++k) w[k] = hg * F[n3 + k] + F[k];
  FormRight(hg, F, w);
  if (smooth_) {
    smooth_->Solve(w, row_.data());
  } else {
    saddle_->Solve(w, row_.data());
  }
#pragma GCC ivdep
  for (int k = 0; k < n3; ++k) {
    out[k] = hg * w[k];
    out[n3 + k] = w[k] - F[k];
  }
  for (int k = 6 * n_; k < size_; ++k) out[k] = hg * F[k];
}

double Rosenbrock::Try(double h) {
  h_ = h;
  if (!linearised_) Linearise();
  if (factored_h_ != h) {
    const double hg = h * table_.gamma;
    if (smooth_) {
      smooth_->Factor(tangent_, jacobian_.data(), hg, hg * hg);
    } else {
      saddle_->Factor(tangent_, jacobian_.data(), hg, hg * hg);
    }
    factored_h_ = h;
  }
  const double* __restrict y = y_.data();
  double* __restrict at = stage_.data();
  for (int i = 0; i < table_.stages; ++i) {
    if (i == 0) {
      std::copy(f0_.begin(), f0_.end(), rate_.begin());
    } else {
      std::copy(y_.begin(), y_.end(), stage_.begin());
      for (int j = 0; j < i; ++j) {
        const double factor = a_[i][j];
        if (factor == 0.0) continue;
        const double* __restrict u = u_[j].data();
#pragma GCC ivdep
        for (int k = 0; k < size_; ++k) at[k] += factor * u[k];
      }
      dynamics_.RightSide(t_ + at_[i] * h, stage_.data(), rate_.data());
      ++evaluations_;
    }
    Stage(i, h);
  }
  double* __restrict out = trial_.data();
#pragma GCC ivdep
  for (int k = 0; k < size_; ++k) out[k] = y[k];
  for (int i = 0; i < table_.stages; ++i) {
    const double* __restrict u = u_[i].data();
    const double factor = m_[i];
#pragma GCC ivdep
    for (int k = 0; k < size_; ++k) out[k] += factor * u[k];
  }
  // The error, over rate_.
  double* __restrict error = rate_.data();
  std::fill(rate_.begin(), rate_.end(), 0.0);
  for (int i = 0; i < table_.stages; ++i) {
    const double* __restrict u = u_[i].data();
    const double factor = e_[i];
#pragma GCC ivdep
    for (int k = 0; k < size_; ++k) error[k] += factor * u[k];
  }
  const double norm = kStrictness * Norm(y, out, [=](int k) { return error[k]; });
  if (norm <= 1.0) RefreshTrial();
  return norm;
}

double Rosenbrock::ErrorOf(int k) const { return rate_[k]; }

void Rosenbrock::RefreshTrial() {
  dynamics_.RightSide(t_ + h_, trial_.data(), f1_.data());
  ++evaluations_;
  KeepMultipliers(&end_lambda_);
}

void Rosenbrock::Accept(double t) {
  t_ = t;
  std::swap(y_, trial_);
  std::swap(f0_, f1_);
  std::swap(lambda_, end_lambda_);
  linearised_ = false;
}

void Rosenbrock::AcceptUntil(double sigma, double t) {
  Dense(sigma, stage_.data());
  std::swap(y_, stage_);
  t_ = t;
}

// Positions: the cubic through both states and their velocities. Velocities: its derivative, since
// the accelerations of stiff parts at either end are far greater than what the step went through.
// The rest: the cubic through values and rates.
DensePolynomial Rosenbrock::Polynomial(int k) {
  const int n3 = 3 * n_;
  if (k >= n3 && k < 2 * n3) {
    const double v0 = y_[k], v1 = trial_[k], d = (trial_[k - n3] - y_[k - n3]) / h_;
    return {{v0, 6.0 * d - 4.0 * v0 - 2.0 * v1, 3.0 * (v0 + v1 - 2.0 * d)}, 3};
  }
  const bool position = k < n3;
  const double r0 = h_ * (position ? y_[n3 + k] : f0_[k]);
  const double r1 = h_ * (position ? trial_[n3 + k] : f1_[k]);
  const double d = trial_[k] - y_[k];
  return {{y_[k], r0, 3.0 * d - 2.0 * r0 - r1, r0 + r1 - 2.0 * d}, 4};
}

}  // namespace unfurl::sim
