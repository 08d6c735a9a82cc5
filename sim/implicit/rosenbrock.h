#pragma once

#include <array>
#include <memory>
#include <vector>

#include "sim/implicit/kkt.h"
#include "sim/implicit/kkt_smooth.h"
#include "sim/methods/stepper.h"

namespace unfurl::sim {

// Coefficients of a Rosenbrock-W method in the usual notation,
//   (I - h gamma A) k_i = h f(t + c_i h, y + sum alpha_ij k_j) + h A sum gamma_ij k_j,
//   y_1 = y + sum b_i k_i,
// whose order holds for any matrix A.
struct RosenbrockTable {
  static constexpr int kMostStages = 6;  // that a table has room for
  const char* name = "";
  int stages = 0;
  int error_order = 0;                          // by which the error estimate falls with the step
  double gamma = 0.0;                           // [-]
  double alpha[kMostStages][kMostStages] = {};  // [-]
  double coupling[kMostStages][kMostStages] = {};  // gamma_ij, j < i [-]
  double b[kMostStages] = {};                      // [-]
  double b_hat[kMostStages] = {};                  // [-]
};

// Third order, embedded second, L-stable, stiffly accurate: Rang and Angermann (2005), ROS34PW2.
const RosenbrockTable& Ros34Pw2();

// The implicit method: linearly implicit steps on the equations of motion with the multipliers
// eliminated, y = (q, v), v' = a(t, q, v). With A the tangent's part of the Jacobian, which leaves
// out how the constraints' directions turn, a stage is one solve with
//   [M + h gamma D + (h gamma)^2 K, J^T; J, 0],
// factored once per step. No iteration, no memory of former steps.
class Rosenbrock : public Stepper {
 public:
  Rosenbrock(Dynamics& dynamics, const ErrorScale& scale, const RosenbrockTable& table);

  int ErrorOrder() const override { return table_.error_order; }
  const char* name() const override { return table_.name; }
  double Strictness() const override;
  double StepOverhead() const override;
  void Refresh() override;
  double Try(double h) override;
  bool EndsAtTrial() const override { return true; }
  void RefreshTrial() override;
  void Accept(double t) override;
  void AcceptUntil(double sigma, double t) override;
  DensePolynomial Polynomial(int entry) override;

 protected:
  double ErrorOf(int entry) const override;

 private:
  void Linearise();
  void KeepMultipliers(Array* to) const;
  void FormRight(double hg, double* v, double* w);
  void Stage(int i, double h);

  RosenbrockTable table_;
  // Of the form without products with A: u_i = sum gamma_ij k_j.
  double a_[RosenbrockTable::kMostStages][RosenbrockTable::kMostStages] = {};
  double c_[RosenbrockTable::kMostStages][RosenbrockTable::kMostStages] = {};
  double m_[RosenbrockTable::kMostStages] = {}, e_[RosenbrockTable::kMostStages] = {};
  double at_[RosenbrockTable::kMostStages] = {};
  Tangent tangent_;
  std::unique_ptr<Saddle> saddle_;
  std::unique_ptr<SmoothSaddle> smooth_;  // in its place where beams are smooth
  std::vector<Array> u_;
  Array f0_, f1_, rate_, solution_, row_, jacobian_, lambda_, end_lambda_;  // [SI]
  bool linearised_ = false;
  double factored_h_ = 0.0;  // [s]
};

}  // namespace unfurl::sim
