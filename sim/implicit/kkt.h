#pragma once

#include <vector>

#include "sim/constraints/constraints.h"
#include "sim/constraints/sparse_ldlt.h"
#include "sim/implicit/kkt_tree.h"
#include "sim/implicit/tangent.h"

namespace unfurl::sim {

// Solves the saddle-point system of an implicit step,
//   [W  J^T] [x ]   [r]
//   [J   0 ] [mu] = [g],     W = M + a D + b K,
// with the mass M, the tangent's D and K and the constraints' Jacobian J, in O(n) on chains and
// trees: by blocks there (TreeSaddle), by single entries where loops close. W must be definite,
// which small steps ensure. Nothing is allocated after construction.
class Saddle {
 public:
  // `tangent` has its pattern already.
  Saddle(const RigidBodies& bodies, const Constraints& constraints, const Tangent& tangent,
         bool by_blocks = true);

  bool by_blocks() const { return tree_.applies(); }
  // Factors with the numbers of `tangent` and of J (six a row, Constraints::Jacobian).
  void Factor(const Tangent& tangent, const double* jacobian, double a, double b);
  // `x`: on entry r, three blocks of the bodies; on return the solution, zero where nothing moves.
  // `g` by row of the constraints, overwritten; null: zero.
  void Solve(double* x, const double* g);
  // g = J v.
  void JacobianTimes(const double* jacobian, const double* v, double* g) const;

 private:
  TreeSaddle tree_;
  struct Scatter {  // where the entries of a block go
    int source;     // block of a pair, or of J
    int place[9];   // in off_
  };

  int n_ = 0, rows_ = 0;
  std::vector<int> moving_, still_;  // bodies
  Array mass_, inertia_;             // by body [kg], [kg m^2]
  struct Row {                       // of J
    int row, inner, outer;           // bodies
  };
  struct Entry {
    int source, place;  // in J, in off_
  };
  std::vector<Row> row_list_;
  std::vector<Scatter> pair_at_, diagonal_at_;
  std::vector<Entry> jacobian_at_;
  SparseLdlt ldlt_;
  Array diagonal_, off_, inverse_, x_;  // of the system and its solution [SI]
};

}  // namespace unfurl::sim
