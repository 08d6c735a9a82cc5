#pragma once

#include <memory>
#include <vector>

#include "sim/dynamics/dynamics.h"
#include "sim/implicit/kkt.h"
#include "sim/implicit/kkt_smooth.h"

namespace unfurl::sim {

// A system about a state at rest, M q'' + D q' + K q = J^T mu, J q = 0. Vectors are three blocks of
// the bodies and kBlock entries more; of smooth beams what is attached is filled in from their
// coordinates.
class Linearised {
 public:
  // `by_blocks`: as Saddle, without smooth beams. Faster, and exact to fewer digits where b K is
  // far above M.
  explicit Linearised(Dynamics* dynamics, bool by_blocks = true);

  // Takes M, D, K and J at y; runs the right side there, and leaves its accelerations in rate().
  void About(double* y);
  const std::vector<double>& rate() const { return rate_; }
  // Of vectors, what moves by itself, and where forces are: the unknowns.
  const std::vector<int>& entries() const { return entries_; }
  int rows() const { return rows_; }
  int constraints() const { return dynamics_.model().constraints.count(); }  // without empty rows
  std::size_t length() const { return 3 * static_cast<std::size_t>(n_) + kBlock; }

  // Fills in what is attached to smooth beams.
  void Fill(double* v) const;
  // w = M w.
  void MassTimes(double* w) const;
  // w += K v, w += D v, v filled in; entries other than those of entries() are of no meaning.
  void AddStiffness(const double* v, double* w) const;
  void AddDamping(const double* v, double* w) const;
  // g = J v, v filled in; rows() entries.
  void JacobianTimes(const double* v, double* g) const;
  // (M + b K) x = r + J^T mu, J x = g: as Saddle.
  void Factor(double b);
  void Solve(double* x, const double* g);
  // An estimate of the largest magnitude of omega^2 [1/s^2].
  double Stiffest() const;
  // The root of the sum of squares of K_dd v_d^2, v filled in: how far one rounding of each term
  // takes v^T K v, over the machine's epsilon [1/s^2 where v^T M v = 1].
  double StiffnessSize(const double* v) const;

 private:
  Dynamics& dynamics_;
  int n_ = 0, rows_ = 0;
  bool by_blocks_;
  std::vector<double> rate_, lambda_, jacobian_, load_x_, load_y_;
  std::vector<int> entries_;
  Tangent tangent_;
  std::unique_ptr<Saddle> saddle_;
  std::unique_ptr<SmoothSaddle> smooth_;  // one of the two
};

}  // namespace unfurl::sim
