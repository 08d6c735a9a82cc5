#pragma once

#include <string>
#include <vector>

#include "sim/constraints/partition.h"
#include "sim/methods/dormand_prince.h"
#include "sim/methods/runge_kutta_43.h"

namespace unfurl::sim {

// The paper's method: generalized coordinate partitioning with a variable-step Runge-Kutta method,
// Dormand and Prince's of fifth order or, where the tolerance is loose, one of fourth, which stays
// stable on undamped vibrations at twice the step. Independent coordinates and velocities are
// integrated; at every stage the dependent ones follow from the constraints, coordinates by
// Newton's method, velocities by the linear equations. Where the pivots of the dependent
// coordinates turn bad, others are chosen.
template <typename Pair>
class Partitioned : public Pair {
 public:
  Partitioned(Dynamics& dynamics, const ErrorScale& scale);

  std::string Description() const override {
    return std::string("generalized coordinate partitioning, ") + Pair::name();
  }
  void Refresh() override;
  void RefreshTrial() override;
  double Try(double h) override;
  void Drop() override { factored_ = false; }
  long repartitions() const override { return repartitions_; }

 protected:
  // Dependent coordinates and velocities from the independent ones; false where Newton fails.
  bool Settle(double t, double* y) override;

 private:
  using Pair::dynamics_;
  using Pair::h_;
  using Pair::kGivenUp;
  using Pair::n_;
  using Pair::scale_;
  using Pair::t_;
  using Pair::trial_;
  using Pair::y_;

  // False where the dependent coordinates chosen cannot be trusted there.
  bool FactorAt(double t, double* y);
  // Chooses dependent coordinates at `y`.
  void Repartition(double t, double* y);
  bool Iterate(double t, double* y, bool velocities, double enough);

  // How far out and how fast the bodies are, for what rounding leaves of the constraints.
  void Measure();

  JacobianEntries entries_;
  Partition partition_;
  double farthest_ = 0.0, fastest_ = 0.0;  // [m], [m/s]
  const bool constrained_;
  bool factored_ = false;  // at state(), or at the trial
  double worst_ = 1.0;     // pivot of that factor [-]
  long repartitions_ = 0;
};

extern template class Partitioned<DormandPrince>;
extern template class Partitioned<RungeKutta43>;

}  // namespace unfurl::sim
