#include "sim/partitioned.h"

#include <algorithm>

namespace unfurl::sim {
namespace {

// Pivots over the largest entry of their row: below the first others are chosen for the next step,
// below the second the step that led there is not trusted.
constexpr double kBadPivot = 0.35, kLostPivot = 0.1;
constexpr double kEnough = 0.01;     // of the tolerance: constraints are met that well
constexpr double kRounding = 1e-13;  // of the scale: they are not asked to be met better than that
constexpr int kMostIterations = 5;   // with one factor

}  // namespace

Partitioned::Partitioned(Dynamics& dynamics, const ErrorScale& scale)
    : DormandPrince(dynamics, scale),
      partition_(dynamics.model().constraints, dynamics.model().slots, scale.length),
      jacobian_(6 * dynamics.model().constraints.rows(), 0.0),
      constrained_(dynamics.model().constraints.count() > 0) {}

void Partitioned::Repartition(double t, double* y) {
  dynamics_.EvaluateConstraints(t, y);
  dynamics_.Jacobian(t, y, jacobian_.data());
  partition_.Choose(jacobian_.data());
  worst_ = 1.0;
  factored_ = true;
}

bool Partitioned::FactorAt(double t, double* y) {
  dynamics_.EvaluateConstraints(t, y);
  dynamics_.Jacobian(t, y, jacobian_.data());
  bool turned = false;
  worst_ = partition_.Factor(jacobian_.data(), &turned);
  factored_ = true;
  return !turned && worst_ > kLostPivot;
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
  if (!constrained_) return true;
  const double length = std::max(kEnough * scale_.rtol, kRounding) * scale_.length;
  const double speed = std::max(kEnough * scale_.rtol, kRounding) * scale_.speed;
  for (const bool velocities : {false, true}) {
    const double enough = velocities ? speed : length;
    if (Iterate(t, y, velocities, enough)) continue;
    if (!FactorAt(t, y) || !Iterate(t, y, velocities, enough)) return false;
  }
  return true;
}

void Partitioned::Refresh() {
  if (constrained_) {
    Repartition(t_, y_.data());
    Settle(t_, y_.data());
  }
  DormandPrince::Refresh();
}

void Partitioned::RefreshTrial() {
  if (constrained_) Settle(t_ + h_, trial_.data());
  DormandPrince::RefreshTrial();
}

double Partitioned::Try(double h) {
  if (!constrained_) return DormandPrince::Try(h);
  if (!factored_) lost_ = !FactorAt(t_, y_.data()) || lost_;
  if (lost_ || worst_ < kBadPivot) {
    Repartition(t_, y_.data());
    ++repartitions_;
    lost_ = false;
  }
  const double error = DormandPrince::Try(h);
  if (error <= 1.0 && FactorAt(t_ + h, trial_.data())) return error;
  factored_ = false;
  lost_ = error <= 1.0 || error >= kGivenUp;
  return lost_ ? kGivenUp : error;
}

}  // namespace unfurl::sim
