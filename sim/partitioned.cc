#include "sim/partitioned.h"

#include <algorithm>

namespace unfurl::sim {
namespace {

constexpr double kBadPivot = 0.05;   // over the largest entry of its row
constexpr double kEnough = 0.01;     // of the tolerance: constraints are met that well
constexpr double kRounding = 1e-13;  // of the scale: they are not asked to be met better than that
constexpr int kMostIterations = 5;   // with one factor

}  // namespace

Partitioned::Partitioned(Dynamics& dynamics, const ErrorScale& scale)
    : DormandPrince(dynamics, scale),
      partition_(dynamics.model().constraints, dynamics.model().slots, scale.length),
      jacobian_(6 * dynamics.model().constraints.rows(), 0.0) {}

void Partitioned::Repartition(double t, double* y) {
  dynamics_.EvaluateConstraints(t, y);
  dynamics_.Jacobian(t, y, jacobian_.data());
  partition_.Choose(jacobian_.data());
  factored_ = true;
}

void Partitioned::FactorAt(double t, double* y) {
  dynamics_.EvaluateConstraints(t, y);
  dynamics_.Jacobian(t, y, jacobian_.data());
  const double worst = partition_.Factor(jacobian_.data());
  factored_ = true;
  if (worst >= kBadPivot) return;
  partition_.Choose(jacobian_.data());
  ++repartitions_;
}

bool Partitioned::Iterate(double t, double* y, bool velocities, double enough) {
  double before = HUGE_VAL;
  for (int k = 0; k < kMostIterations; ++k) {
    const double off =
        velocities ? dynamics_.EvaluateConstraintRates(t, y) : dynamics_.EvaluateConstraints(t, y);
    if (off <= enough) return true;
    if (!(off < 0.5 * before)) return false;  // no use with this factor
    before = off;
    partition_.Correct(dynamics_.constraint_rows(), velocities ? y + 3 * n_ : y);
  }
  return false;
}

bool Partitioned::Settle(double t, double* y) {
  if (dynamics_.model().constraints.count() == 0) return true;
  if (!chosen_) {
    Repartition(t, y);
    chosen_ = true;
  }
  if (!factored_) FactorAt(t, y);
  const double length = std::max(kEnough * scale_.rtol, kRounding) * scale_.length;
  const double speed = std::max(kEnough * scale_.rtol, kRounding) * scale_.speed;
  if (!Iterate(t, y, false, length)) {
    FactorAt(t, y);
    if (!Iterate(t, y, false, length)) return false;
  }
  if (Iterate(t, y, true, speed)) return true;
  FactorAt(t, y);
  return Iterate(t, y, true, speed);
}

void Partitioned::Refresh() {
  factored_ = false;
  Settle(t_, y_.data());
  DormandPrince::Refresh();
}

void Partitioned::RefreshTrial() {
  Settle(t_ + h_, trial_.data());
  DormandPrince::RefreshTrial();
}

double Partitioned::Try(double h) {
  if (!factored_ && dynamics_.model().constraints.count() > 0) FactorAt(t_, y_.data());
  return DormandPrince::Try(h);
}

void Partitioned::Accept(double t) {
  DormandPrince::Accept(t);
  factored_ = false;
}

}  // namespace unfurl::sim
