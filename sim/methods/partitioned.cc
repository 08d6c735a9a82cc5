#include "sim/methods/partitioned.h"

#include <algorithm>
#include <cmath>

namespace unfurl::sim {
namespace {

// Pivots over the largest entry of their row: below the first others are chosen for the next step,
// below the second the step that led there is not trusted.
constexpr double kBadPivot = 0.35, kLostPivot = 0.1;
constexpr double kNearPivot = 0.1;  // from here on constraints are near to depending on one another
constexpr double kEnough = 0.01;    // of the tolerance: constraints are met that well
constexpr double kRounding = 1e-14;  // of the largest coordinate and velocity
constexpr int kMostIterations = 5;   // with one factor

}  // namespace

template <typename Pair>
Partitioned<Pair>::Partitioned(Dynamics& dynamics, const ErrorScale& scale)
    : Pair(dynamics, scale),
      entries_(dynamics.model()),
      partition_(entries_, scale.length),
      constrained_(dynamics.model().constraints.count() > 0) {}

template <typename Pair>
void Partitioned<Pair>::Repartition(double t, double* y) {
  dynamics_.EvaluateConstraints(t, y);
  partition_.Choose(entries_.At(dynamics_, t, y));
  worst_ = 1.0;
  factored_ = true;
}

template <typename Pair>
bool Partitioned<Pair>::FactorAt(double t, double* y) {
  dynamics_.EvaluateConstraints(t, y);
  bool turned = false;
  worst_ = partition_.Factor(entries_.At(dynamics_, t, y), &turned);
  factored_ = true;
  return !turned && worst_ > kLostPivot;
}

template <typename Pair>
bool Partitioned<Pair>::Iterate(double t, double* y, bool velocities, double enough) {
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

template <typename Pair>
bool Partitioned<Pair>::Settle(double t, double* y) {
  if (!constrained_) return true;
  // Near a state where constraints depend on one another, what is left of them counts for more.
  const double near = std::min(1.0, partition_.smallest_pivot() / kNearPivot);
  const double part = kEnough * scale_.rtol * near * near;
  for (const bool velocities : {false, true}) {
    const double enough = velocities ? std::max(part * scale_.speed, kRounding * fastest_)
                                     : std::max(part * scale_.length, kRounding * farthest_);
    if (Iterate(t, y, velocities, enough)) continue;
    FactorAt(t, y);
    if (!Iterate(t, y, velocities, enough)) return false;
  }
  return true;
}

template <typename Pair>
void Partitioned<Pair>::Measure() {
  farthest_ = scale_.length;
  fastest_ = scale_.speed;
  for (int k = 0; k < 2 * n_; ++k) {
    farthest_ = std::max(farthest_, std::fabs(y_[k]));
    fastest_ = std::max(fastest_, std::fabs(y_[3 * n_ + k]));
  }
}

template <typename Pair>
void Partitioned<Pair>::Refresh() {
  if (constrained_) {
    Measure();
    Repartition(t_, y_.data());
    Settle(t_, y_.data());
  }
  Pair::Refresh();
}

template <typename Pair>
void Partitioned<Pair>::RefreshTrial() {
  if (constrained_) Settle(t_ + h_, trial_.data());
  Pair::RefreshTrial();
}

template <typename Pair>
double Partitioned<Pair>::Try(double h) {
  if (!constrained_) return Pair::Try(h);
  Measure();
  const bool good = factored_ || FactorAt(t_, y_.data());
  bool fresh = !good || worst_ < kBadPivot;
  for (;; fresh = true) {
    if (fresh) {
      Repartition(t_, y_.data());
      ++repartitions_;
    }
    const double error = Pair::Try(h);
    factored_ = false;
    if (error > 1.0 && (error < kGivenUp || fresh)) return error;
    // Where the coordinates were just chosen and the step is good, a lost pivot is the constraints'
    // own: they depend on one another somewhere in the step.
    if (error <= 1.0) {
      factored_ = true;
      if (FactorAt(t_ + h, trial_.data()) || fresh) return error;
    } else if (!std::isfinite(error)) {
      return error;
    }
  }
}

template class Partitioned<DormandPrince>;
template class Partitioned<RungeKutta43>;

}  // namespace unfurl::sim
