#pragma once

#include <array>

#include "sim/methods/stepper.h"

namespace unfurl::sim {

// The explicit Runge-Kutta pair 5(4) of Dormand and Prince (1980) with its dense output of fourth
// order (Hairer, Norsett and Wanner, Solving ODEs I, II.6). The last stage is the right side at the
// trial state.
class DormandPrince : public Stepper {
 public:
  DormandPrince(Dynamics& dynamics, const ErrorScale& scale);

  int ErrorOrder() const override { return 5; }
  const char* name() const override { return "Dormand-Prince 5(4)"; }
  void Refresh() override;
  double Try(double h) override;
  bool EndsAtTrial() const override { return true; }
  void RefreshTrial() override;
  void Accept(double t) override;
  DensePolynomial Polynomial(int entry) override;
  void Dense(double sigma, double* out) override;
  double StabilityUse() const override;
  double StabilityEdge() const override;
  double StableReach() const override;

 protected:
  double ErrorOf(int entry) const override;

 private:
  double Dense(int entry, double sigma) const;
  std::array<Array, 7> k_;
};

}  // namespace unfurl::sim
