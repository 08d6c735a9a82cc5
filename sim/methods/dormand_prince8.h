#pragma once

#include <array>

#include "sim/methods/stepper.h"

namespace unfurl::sim {

// The explicit Runge-Kutta method of eighth order of Dormand and Prince with error estimates of
// fifth and third order and dense output of seventh (DOP853; Hairer, Norsett and Wanner, Solving
// ODEs I, II.5, II.6 and II.10). Twelve evaluations a step; three more where the inside of the step
// is asked for.
class DormandPrince8 : public Stepper {
 public:
  DormandPrince8(Dynamics& dynamics, const ErrorScale& scale);

  int ErrorOrder() const override { return 8; }
  const char* name() const override { return "Dormand-Prince 8(5,3)"; }
  void Refresh() override;
  double Try(double h) override;
  bool EndsAtTrial() const override { return true; }
  void RefreshTrial() override;
  void Accept(double t) override;
  DensePolynomial Polynomial(int entry) override;
  void Dense(double sigma, double* out) override;
  // By what the polynomials' rates differ from the right side there; evaluates it once, at
  // another place than trial().
  double DenseDoubt(double sigma) override;
  bool DenseIsFree() const override { return dense_; }
  DensePolynomial Cubic(int entry, double* margin) const override;
  double StabilityUse() const override;
  double StabilityEdge() const override;
  double StableReach() const override;

 protected:
  double ErrorOf(int entry) const override;

 private:
  // The three further stages, and the combinations of stages that the polynomials take.
  void MakeDense();

  // By stage; those that only serve the next ones (1 to 4) hold the polynomials' combinations once
  // dense_.
  std::array<Array, 16> k_;
  Array inner_, inner_rate_;  // a state within the step, and what its rates are off by [SI]
  bool dense_ = false;
};

}  // namespace unfurl::sim
