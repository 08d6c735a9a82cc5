#pragma once

#include <memory>

#include "data/beam_section.h"
#include "sim/model/aligned.h"

namespace unfurl::sim {

class TaperedShapes;

// Tables of a planar, inextensible, shear-rigid rod (Kirchhoff) whose centre line has the angle
//   theta(x) = theta_0 + sum_k a_k N_k(x),   x in [0, 1] from start to end,
// and the position
//   r(x) = r_c + L int_0^1 G(x, x') t(theta(x')) dx',   t = (cos, sin),
// r_c the centre of mass and G the influence of a direction at x' on the place at x (the step
// function less its mean over the rod). Integrals are Gauss's: what is integrated stands for its
// interpolant through the points, which is then integrated exactly.
//
// The N_k span what a beam in a mechanism needs (component mode synthesis with residual attachment
// modes: MacNeal 1971, Craig 1981; docs/decisions/010-second-beam.md): the lowest modes of the free
// beam, and for each force or moment that an end may take the shape in which it, held by the free
// beam's own inertia, bends it, a polynomial. Of this space the N_k are the natural modes, so that
// stiffness and, while the beam is straight, mass are diagonal. Their mean is zero (theta_0 is the
// mean angle) and that of their square is one. Where the section changes along the beam, density
// and stiffness weigh the integrals, and the shapes are those of such a beam (TaperedShapes).
//
// Of a rod that stretches, t becomes lambda t, lambda = 1 + sum_j b_j E_j(x): its strain is a sum
// of further shapes, each an axial force that is a polynomial over the section's area. They stand
// in the columns after the N_k, of which each table has zeros there, and are natural modes of their
// space, too.
struct KirchhoffShapes {
  struct Ends {  // what may act there
    bool force_at_start = false, moment_at_start = false;
    bool force_at_end = false, moment_at_end = false;
    int count() const { return force_at_start + moment_at_start + force_at_end + moment_at_end; }
  };
  static constexpr int kMostModes = 11;  // as data::kHighestOrder
  // Strains beside so many modes: with three, uniform tension, weight along the beam and the
  // centrifugal force, a polynomial of degree two, are all exact.
  static constexpr int kMoreStretches = 2;
  static int StretchesFor(int modes) { return modes + kMoreStretches; }
  static constexpr int kMostShapes = kMostModes + 4 + kMostModes + kMoreStretches;

  KirchhoffShapes() = default;
  // `modes` of the free beam, in [0, kMostModes]; with none and no force at an end there is
  // nothing.
  KirchhoffShapes(int modes, Ends ends, const data::BeamSection& section = {}, int stretches = 0);

  // N_k(x), k = 0 the constant 1, and its derivative; zero of columns of strains.
  double Shape(int k, double x) const;
  double Slope(int k, double x) const;
  // E_j(x), j from 0.
  double Strain(int j, double x) const;
  // Weights w_q of r(x) = r_c + L sum_q w_q t(theta(x_q)), by point.
  Array Arm(double x) const;
  // N_k(x) by column, `width` of them.
  Array ShapesAt(double x) const;

  int modes = 0;
  Ends ends;
  int bends = 0;      // p, the N_k beside the constant
  int stretches = 0;  // the E_j
  int count = 0;      // both
  int points = 0;     // Q, Gauss points; a multiple of 4
  int width = 0;      // count + 1 padded: columns of the tables
  Array x;            // of the points [-]
  Array weight;       // of the points [-]
  Array shape;        // N_k(x_q), Q x width [-]
  Array strain;       // E_j(x_q) in column bends + 1 + j, Q x width; empty without them [-]
  // int_0^1 G(x, x_q) G(x, x_q') dx (of dx, the part of the mass) with the weights of both: the
  // kinetic energy of a rod of mass m relative to its centre is m L^2 / 2 sum_qq' kernel theta_q'
  // theta_q'' cos(theta_q - theta_q').
  Array kernel;  // Q x Q [-]
  // int_0^1 N_k'^2 dx, times the bending stiffness over that at the start; of strains int_0^1 E_j^2
  // dx, times the area over that at the start; width [-].
  Array stiffness;

 private:
  int KindOf(int k) const;
  double RawShape(int k, double x) const;  // k from 0
  double RawSlope(int k, double x) const;
  void Diagonalize();
  void DiagonalizeStrains();

  data::BeamSection section_;
  std::shared_ptr<const TaperedShapes> tapered_;  // null: the section does not change
  Array centre_;  // means over the mass of what Arm integrates, of a changing section; by degree

  Array mix_;         // N_k = sum_j mix_[(k - 1) bends + j] raw_j
  Array strain_mix_;  // E_j = sum_i strain_mix_[j stretches + i] P_i / area
};

}  // namespace unfurl::sim
