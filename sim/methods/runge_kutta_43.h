#pragma once

#include <array>

#include "sim/methods/stepper.h"

namespace unfurl::sim {

// The classical Runge-Kutta method of fourth order, with an error of third order from the right
// side at the trial state (Dormand, Numerical Methods for Differential Equations, 1996, RK4(3)T).
// Its stability reaches 2.83 along the imaginary axis in four evaluations, Dormand-Prince's 1.0 in
// six: where undamped beams limit the step, it is the cheaper by a factor of two to four. Dense
// output is the cubic through both states and their rates.
class RungeKutta43 : public Stepper {
 public:
  RungeKutta43(Dynamics& dynamics, const ErrorScale& scale);

  int ErrorOrder() const override { return 4; }
  const char* name() const override { return "Runge-Kutta 4(3)"; }
  void Refresh() override;
  double Try(double h) override;
  void Accept(double t) override;
  DensePolynomial Polynomial(int entry) override;
  double StabilityUse() const override;
  double StabilityEdge() const override;
  double StableReach() const override;

 protected:
  double ErrorOf(int entry) const override;

 private:
  std::array<Array, 5> k_;
};

}  // namespace unfurl::sim
