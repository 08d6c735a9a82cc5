#pragma once

#include <string>
#include <vector>

#include "sim/constraints/partition.h"
#include "sim/methods/dormand_prince.h"

namespace unfurl::sim {

// The paper's method: generalized coordinate partitioning with a variable-step Runge-Kutta method
// of fourth and fifth order (Dormand and Prince's). Independent coordinates and velocities are
// integrated; at every stage the dependent ones follow from the constraints, coordinates by
// Newton's method, velocities by the linear equations. Where the pivots of the dependent
// coordinates turn bad, others are chosen.
class Partitioned : public DormandPrince {
 public:
  Partitioned(Dynamics& dynamics, const ErrorScale& scale);

  const char* name() const override { return "partitioned"; }
  std::string Description() const override {
    return "generalized coordinate partitioning, Dormand-Prince 5(4)";
  }
  void Refresh() override;
  void RefreshTrial() override;
  double Try(double h) override;
  long repartitions() const override { return repartitions_; }

 protected:
  // Dependent coordinates and velocities from the independent ones; false where Newton fails.
  bool Settle(double t, double* y) override;

 private:
  // False where the dependent coordinates chosen cannot be trusted there.
  bool FactorAt(double t, double* y);
  // Chooses dependent coordinates at `y`.
  void Repartition(double t, double* y);
  bool Iterate(double t, double* y, bool velocities, double enough);

  // How far out and how fast things are, for what rounding leaves of the constraints.
  void Measure();

  Partition partition_;
  double farthest_ = 0.0, fastest_ = 0.0;  // [m], [m/s]
  std::vector<double> jacobian_;           // six a row
  const bool constrained_;
  bool factored_ = false;  // at state(), or at the trial
  double worst_ = 1.0;     // pivot of that factor
  long repartitions_ = 0;
};

}  // namespace unfurl::sim
