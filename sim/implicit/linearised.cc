#include "sim/implicit/linearised.h"

#include <algorithm>
#include <cmath>

namespace unfurl::sim {

Linearised::Linearised(Dynamics* dynamics, bool by_blocks)
    : dynamics_(*dynamics),
      n_(dynamics->model().rigid_bodies.count),
      rows_(dynamics->model().constraints.rows()),
      by_blocks_(by_blocks),
      rate_(dynamics->model().index.size()),
      lambda_(rows_ + 1, 0.0),
      jacobian_(6 * rows_ + 6, 0.0),
      load_x_(n_),
      load_y_(n_) {
  const RigidBodies& bodies = dynamics->model().rigid_bodies;
  if (dynamics->model().kirchhoff.count() > 0) return;  // with the first state
  for (int s = 0; s < n_; ++s) {
    if (!bodies.IsDynamic(s)) continue;
    for (int d = 0; d < 3; ++d) entries_.push_back(d * n_ + s);
  }
}

void Linearised::About(double* y) {
  const Model& model = dynamics_.model();
  dynamics_.RightSide(0.0, y, rate_.data());
  const Constraints::Work& work = dynamics_.constraint_work();
  std::copy_n(work.lambda.begin(), rows_, lambda_.begin());
  dynamics_.FillTangent(0.0, y, lambda_.data(), &tangent_);
  if (rows_ > 0) dynamics_.Jacobian(0.0, y, jacobian_.data());
  if (model.kirchhoff.count() == 0) {
    if (!saddle_) {
      saddle_ =
          std::make_unique<Saddle>(model.rigid_bodies, model.constraints, tangent_, by_blocks_);
    }
    return;
  }
  if (!smooth_) {
    smooth_ = std::make_unique<SmoothSaddle>(model.rigid_bodies, model.kirchhoff, model.constraints,
                                             tangent_);
    entries_ = smooth_->Entries();
  }
  dynamics_.ForcesOnBodies(load_x_.data(), load_y_.data());
  smooth_->LineariseFully(model.kirchhoff, work.smooth_work, load_x_.data(), load_y_.data());
}

void Linearised::Fill(double* v) const {
  if (smooth_) smooth_->FillAttached(v);
}

void Linearised::MassTimes(double* w) const {
  if (smooth_) return smooth_->MassTimes(w);
  const RigidBodies& bodies = dynamics_.model().rigid_bodies;
  for (int k = 0; k < n_; ++k) {
    w[k] *= bodies.mass[k];
    w[n_ + k] *= bodies.mass[k];
    w[2 * n_ + k] *= bodies.inertia[k];
  }
}

void Linearised::AddStiffness(const double* v, double* w) const {
  smooth_ ? smooth_->AddStiffness(tangent_, 1.0, v, w) : tangent_.AddStiffness(1.0, v, w);
}

void Linearised::AddDamping(const double* v, double* w) const {
  smooth_ ? smooth_->AddDamping(tangent_, 1.0, v, w) : tangent_.AddDamping(1.0, v, w);
}

void Linearised::JacobianTimes(const double* v, double* g) const {
  smooth_ ? smooth_->JacobianTimes(jacobian_.data(), v, g)
          : saddle_->JacobianTimes(jacobian_.data(), v, g);
}

void Linearised::Factor(double b) {
  smooth_ ? smooth_->Factor(tangent_, jacobian_.data(), 0.0, b)
          : saddle_->Factor(tangent_, jacobian_.data(), 0.0, b);
}

void Linearised::Solve(double* x, const double* g) {
  smooth_ ? smooth_->Solve(x, g) : saddle_->Solve(x, g);
}

double Linearised::Stiffest() const {
  if (smooth_) return smooth_->Stiffest(tangent_);
  const RigidBodies& bodies = dynamics_.model().rigid_bodies;
  double largest = 0.0;
  for (int s = 0; s < n_; ++s) {
    if (!bodies.IsDynamic(s)) continue;
    for (int d = 0; d < 3; ++d) {
      const double mass = d < 2 ? bodies.mass[s] : bodies.inertia[s];
      largest = std::max(largest, std::fabs(tangent_.K(s)[4 * d]) / mass);
    }
  }
  return largest;
}

double Linearised::StiffnessSize(const double* v) const {
  double sum = smooth_ ? smooth_->BendingSquares(v) : 0.0;
  for (int s = 0; s < n_; ++s) {
    for (int d = 0; d < 3; ++d) {
      const double part = v[d * n_ + s];
      const double term = tangent_.K(s)[4 * d] * part * part;
      sum += term * term;
    }
  }
  return std::sqrt(sum);
}

}  // namespace unfurl::sim
