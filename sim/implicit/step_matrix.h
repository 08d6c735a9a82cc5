#pragma once

#include <memory>

#include "sim/dynamics/dynamics.h"
#include "sim/implicit/kkt.h"
#include "sim/implicit/kkt_smooth.h"

namespace unfurl::sim {

/// The matrix I - h gamma A of implicit steps on y = (q, v, energies), y' = (v, a(t, q, v), ...),
/// the multipliers eliminated. A is the tangent's part of the Jacobian, which leaves out how the
/// constraints' directions turn and, of the energies, everything. Factored as
///   [M + h gamma D + (h gamma)^2 K, J^T; J, 0].
class StepMatrix {
 public:
  explicit StepMatrix(Dynamics& dynamics);

  /// At the state of the last right side, with its multipliers by row.
  void Linearise(double t, double* y, const double* lambda);
  /// `hg`: h gamma [s].
  void Factor(double hg);
  /// out = h gamma (I - h gamma A)^-1 F; entries of attached bodies in `F` are filled in.
  void Solve(double* F, double* out);

  /// Takes the drift that the dynamics have looked at last out of three blocks of a state: the
  /// least change in the sense of M + h gamma D + (h gamma)^2 K.
  void RemoveDrift(double* blocks);

  /// Right sides that Linearise with Factor and one Solve cost.
  double FactorCost() const;
  double SolveCost() const;

 private:
  void FormRight(double* v, double* w);

  Dynamics& dynamics_;
  int n_ = 0, size_ = 0;
  double hg_ = 0.0;  // [s]
  Tangent tangent_;
  std::unique_ptr<Saddle> saddle_;
  std::unique_ptr<SmoothSaddle> smooth_;  // in its place where beams are smooth
  Array solution_, row_, jacobian_;       // [SI]
};

}  // namespace unfurl::sim
