#pragma once

#include <array>
#include <cmath>

#include "sim/implicit/step_matrix.h"
#include "sim/methods/stepper.h"

namespace unfurl::sim {

/// Coefficients of a singly diagonally implicit Runge-Kutta pair with an explicit first stage,
///   Y_i = y + h sum_{j<i} a_ij k_j + h gamma k_i,   k_i = f(t + c_i h, Y_i),   y_1 = Y_s.
struct EsdirkTable {
  static constexpr int kStages = 6;  ///< of ARK4(3)6L[2]SA
  const char* name = "";
  int error_order = 0;                          ///< by which the error estimate falls with the step
  double gamma = 0.0;                           ///< [-]
  double a[kStages][kStages] = {};              ///< j < i [-]
  double c[kStages] = {}, b_hat[kStages] = {};  ///< [-]
};

/// Fourth order, embedded third, stage order two, L-stable, stiffly accurate: the implicit part of
/// ARK4(3)6L[2]SA, Kennedy and Carpenter (2003).
const EsdirkTable& Ark436();

/// The implicit method that meets its stages: each is solved by Newton's method with the matrix of
/// the step's start. So stiff axes and springs may turn within a step, which a linearly implicit
/// one does not see, neither in its result nor in its estimate of the error.
class Esdirk : public Stepper {
 public:
  Esdirk(Dynamics& dynamics, const ErrorScale& scale, const EsdirkTable& table);

  int ErrorOrder() const override { return table_.error_order; }
  const char* name() const override { return table_.name; }
  double Strictness() const override;
  double StepOverhead() const override;
  double ProbeFastestRate() override;
  void Refresh() override;
  double Try(double h) override;
  bool EndsAtTrial() const override { return true; }
  void RefreshTrial() override;
  void Accept(double t) override;
  void AcceptUntil(double sigma, double t) override;
  DensePolynomial Polynomial(int entry) override;
  bool Sample(double sigma, double* out) override;
  double DenseDoubt(double sigma) override;
  void Project(double t, double* y) override;

 protected:
  double ErrorOf(int entry) const override;

 private:
  static constexpr int kStages = EsdirkTable::kStages;

  void KeepMultipliers(Array* to) const;
  enum class Newton { kGoesOn, kSolved, kFailed };

  double RoundingOf(double hg) const;
  double PartWanted() const;
  Newton Judge(double norm, double wanted, double enough);
  void BeginStage(int i);
  bool SolveStage(int i);
  double EstimateError();
  double NormOfMasses(const double* x) const;
  double Iterate(int block, int times);

  EsdirkTable table_;
  StepMatrix matrix_;
  std::array<Array, kStages> k_;                     // rates of the stages [SI]
  Array z_, rate_, delta_;                           // h gamma k; of Newton's method [SI]
  Array sample_rate_, sample_delta_, sample_twice_;  // [SI]
  Array lambda_, end_lambda_;                        // at the step's ends
  // What places went through in the last step; trial() may since have been brought back to the
  // constraints, which is no velocity.
  Array went_;
  bool linearised_ = false;
  double factored_h_ = 0.0;  // [s]
  // Of Newton's method at a stage: the last change, in units of the error allowed; its quotient
  // with the one before, the one before that; and the worst rate in this step and the last.
  double change_ = 0.0, quotient_ = 0.0, slowest_ = 0.0, slowest_before_ = 0.0;  // [-]
  int iterations_ = 0;
  double longest_solved_ = HUGE_VAL;  // step, as far as is known [s]
  int solves_ = 0;                    // in the last step
};

}  // namespace unfurl::sim
