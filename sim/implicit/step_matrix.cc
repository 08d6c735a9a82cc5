#include "sim/implicit/step_matrix.h"

#include <algorithm>

#include "base/loop.h"

namespace unfurl::sim {
namespace {

// In right sides: tangent and factorization, and one solve, by blocks, by entries and with smooth
// beams, whose right sides are dear (docs/decisions/195-pairs-at-the-edge.md).
constexpr double kFactorBlocks = 3.1, kFactorEntries = 8.9;
constexpr double kSolveBlocks = 1.25, kSolveEntries = 2.9;
constexpr double kFactorSmooth = 1.6, kSolveSmooth = 0.4;

}  // namespace

StepMatrix::StepMatrix(Dynamics& dynamics)
    : dynamics_(dynamics),
      n_(dynamics.model().rigid_bodies.count),
      size_(dynamics.model().index.size()),
      solution_(3 * n_ + kBlock, 0.0) {
  const Model& model = dynamics.model();
  const Constraints& constraints = model.constraints;
  row_ = Array(constraints.rows() + kBlock, 0.0);
  jacobian_ = Array(6 * constraints.rows() + kBlock, 0.0);
  // A first right side, so that the tangent's pattern can be noted.
  Array y(model.initial_state.begin(), model.initial_state.end()), rate(size_, 0.0);
  y.resize(size_ + kBlock, 0.0);
  dynamics_.RightSide(0.0, y.data(), rate.data());
  dynamics_.FillTangent(0.0, y.data(), row_.data(), &tangent_);
  if (model.kirchhoff.count() > 0) {
    smooth_ =
        std::make_unique<SmoothSaddle>(model.rigid_bodies, model.kirchhoff, constraints, tangent_);
  } else {
    saddle_ = std::make_unique<Saddle>(model.rigid_bodies, constraints, tangent_);
  }
}

double StepMatrix::FactorCost() const {
  if (smooth_) return kFactorSmooth;
  return saddle_->by_blocks() ? kFactorBlocks : kFactorEntries;
}

double StepMatrix::SolveCost() const {
  if (smooth_) return kSolveSmooth;
  return saddle_->by_blocks() ? kSolveBlocks : kSolveEntries;
}

void StepMatrix::Linearise(double t, double* y, const double* lambda) {
  dynamics_.FillTangent(t, y, lambda, &tangent_);
  dynamics_.model().constraints.Jacobian(dynamics_.MotionAt(t, y), dynamics_.constraint_work(),
                                         jacobian_.data());
  if (smooth_) {
    smooth_->Linearise(dynamics_.model().kirchhoff, dynamics_.constraint_work().smooth_work);
  }
}

void StepMatrix::Factor(double hg) {
  hg_ = hg;
  if (smooth_) {
    smooth_->Factor(tangent_, jacobian_.data(), hg, hg * hg);
  } else {
    saddle_->Factor(tangent_, jacobian_.data(), hg, hg * hg);
  }
}

// w := M w + h gamma D v and, before, g = J w; of smooth beams with what is attached to them.
void StepMatrix::FormRight(double* v, double* w) {
  const bool constrained = dynamics_.model().constraints.count() > 0;
  if (smooth_) {
    smooth_->FillAttached(v);
    smooth_->FillAttached(w);
    if (constrained) smooth_->JacobianTimes(jacobian_.data(), w, row_.data());
    smooth_->MassTimes(w);
    smooth_->AddDamping(tangent_, hg_, v, w);
    return;
  }
  if (constrained) saddle_->JacobianTimes(jacobian_.data(), w, row_.data());
  const double* __restrict mass = dynamics_.model().rigid_bodies.mass.data();
  const double* __restrict inertia = dynamics_.model().rigid_bodies.inertia.data();
  UNFURL_INDEPENDENT
  for (int k = 0; k < n_; ++k) {
    w[k] *= mass[k];
    w[n_ + k] *= mass[k];
    w[2 * n_ + k] *= inertia[k];
  }
  tangent_.AddDamping(hg_, v, w);
}

void StepMatrix::RemoveDrift(double* blocks) {
  std::fill(solution_.begin(), solution_.end(), 0.0);
  const Array& drift = dynamics_.constraint_work().drift;
  const int rows = dynamics_.model().constraints.rows();
  for (int r = 0; r < rows; ++r) row_[r] = -drift[r];
  if (smooth_) {
    smooth_->Solve(solution_.data(), row_.data());
  } else {
    saddle_->Solve(solution_.data(), row_.data());
  }
  for (int k = 0; k < 3 * n_; ++k) blocks[k] += solution_[k];
}

// With z = h gamma F_v + F_q the solution is u_q = h gamma w, u_v = w - F_q, where
//   W w - J^T mu = M z + h gamma D F_q,   J w = J z.
void StepMatrix::Solve(double* F, double* out) {
  const int n3 = 3 * n_;
  double* __restrict w = solution_.data();
  UNFURL_INDEPENDENT
  for (int k = 0; k < n3; ++k) w[k] = hg_ * F[n3 + k] + F[k];
  FormRight(F, w);
  if (smooth_) {
    smooth_->Solve(w, row_.data());
  } else {
    saddle_->Solve(w, row_.data());
  }
  UNFURL_INDEPENDENT
  for (int k = 0; k < n3; ++k) {
    out[k] = hg_ * w[k];
    out[n3 + k] = w[k] - F[k];
  }
  for (int k = 6 * n_; k < size_; ++k) out[k] = hg_ * F[k];
}

}  // namespace unfurl::sim
