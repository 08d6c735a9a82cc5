#pragma once

#include <vector>

#include "sim/constraints/constraints.h"
#include "sim/constraints/sparse_ldlt.h"
#include "sim/implicit/tangent.h"
#include "sim/kirchhoff/kirchhoff_beams.h"

namespace unfurl::sim {

// The saddle-point system of an implicit step (sim/implicit/kkt.h) for models with smooth beams. A
// beam's coordinates are one dense block of W, with its full mass matrix and, of its tangent, the
// bending stiffness and its damping, which are what is stiff in it. Bodies attached to a beam have
// no coordinates of their own: with T = d(attached)/d(coordinates), held over the step, what the
// tangent and the constraints say of them is folded onto the beam, T^T K T and J T. Linearised
// fully, K has what turns with the beam, too: it is then the derivative of the forces at rest.
//
// Vectors are three blocks of the bodies, as everywhere.
class SmoothSaddle {
 public:
  // `tangent` has its pattern already.
  SmoothSaddle(const RigidBodies& bodies, const KirchhoffBeams& beams,
               const Constraints& constraints, const Tangent& tangent);

  // Takes mass matrices and T at the beams' last Solve.
  void Linearise(const KirchhoffBeams& beams, const KirchhoffBeams::Work& work);
  // The same, and the stiffness of what turns with a beam at rest; `fx`, `fy`: all that acts on its
  // attached bodies, reactions of constraints included, by body [N].
  void LineariseFully(const KirchhoffBeams& beams, const KirchhoffBeams::Work& work,
                      const double* fx, const double* fy);
  void Factor(const Tangent& tangent, const double* jacobian, double a, double b);
  // As Saddle::Solve; entries of attached bodies are zero on return.
  void Solve(double* x, const double* g);
  // g = J v, v with its attached bodies filled in.
  void JacobianTimes(const double* jacobian, const double* v, double* g) const;
  // Entries of attached bodies: T times those of their beams.
  void FillAttached(double* v) const;
  // w = M w; entries of attached bodies become zero.
  void MassTimes(double* w) const;
  // w += factor D v, v with its attached bodies filled in; entries of attached bodies in w are zero
  // before and after.
  void AddDamping(const Tangent& tangent, double factor, const double* v, double* w) const;
  // w += factor K v, likewise.
  void AddStiffness(const Tangent& tangent, double factor, const double* v, double* w) const;
  // The unknowns as indices into such vectors.
  std::vector<int> Entries() const;
  // An estimate of the largest eigenvalue of M^-1 K [1/s^2].
  double Stiffest(const Tangent& tangent) const;
  // The sum of (K_ii v_i^2)^2 over the beams' own stiffness.
  double BendingSquares(const double* v) const;

 private:
  // What moves a body: three unknowns of its own (`beam` -1), or those of its beam; none for one
  // that cannot move.
  struct Side {
    std::vector<int> unknown;
    int beam = -1, attachment = -1;
  };
  struct Fold {  // of a block between two bodies, of a pair, a body with itself, or a row
    int source;
    int side_a, side_b;
    std::vector<int> place;  // by unknown of a, then of b; -1 where both are one
  };
  struct Beam {
    int size = 0, root = -1;      // coordinates; body
    double damping = 0.0;         // [s]
    std::vector<int> at;          // index into a vector, by coordinate
    std::vector<int> unknown;     // by coordinate
    Array scale;                  // what a vector holds is so many times the coordinate [-]
    Array stiffness;              // d^2V/dq^2 over the scale squared, by coordinate [SI]
    std::vector<int> place;       // of the block's lower triangle, by rows, diagonal left out
    std::vector<int> attached;    // bodies
    KirchhoffRod::Linear linear;  // scaled
    Array geometric;              // of what turns with the beam, scaled; zero unless asked for
  };

  void AddBeam(const KirchhoffBeams::Beam& beam, std::vector<char>* of_beam);
  void AddFold(const Fold& fold, const Tangent::Block& block);
  // What is on attached bodies in w, as forces on their beams.
  void FoldAttached(double* w) const;
  int IndexOf(int unknown) const { return unknown % 3 * n_ + unknown / 3; }
  // Motion of a side with its unknown i: three numbers.
  void Column(const Side& side, int i, double out[3]) const;

  int n_ = 0, rows_ = 0;
  Array mass_, inertia_;  // [kg], [kg m^2]
  std::vector<Beam> list_;
  std::vector<Side> sides_;  // by body
  std::vector<int> rigid_;   // bodies that move by themselves
  std::vector<Fold> pairs_, own_, row_folds_;
  std::vector<int> unknowns_;  // all that are solved for
  std::vector<char> used_row_;
  SparseLdlt ldlt_;
  Array diagonal_, off_, inverse_, x_;  // of the system and its solution [SI]
  mutable Array product_;               // [SI]
};

}  // namespace unfurl::sim
