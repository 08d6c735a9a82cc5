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
struct KirchhoffShapes {
  struct Ends {  // what may act there
    bool force_at_start = false, moment_at_start = false;
    bool force_at_end = false, moment_at_end = false;
    int count() const { return force_at_start + moment_at_start + force_at_end + moment_at_end; }
  };
  static constexpr int kMostModes = 11;  // as data::kHighestOrder
  static constexpr int kMostShapes = kMostModes + 4;

  KirchhoffShapes() = default;
  // `modes` of the free beam, in [0, kMostModes]; with none and no force at an end there is
  // nothing.
  KirchhoffShapes(int modes, Ends ends, const data::BeamSection& section = {});

  // N_k(x), k = 0 the constant 1, and its derivative.
  double Shape(int k, double x) const;
  double Slope(int k, double x) const;
  // Weights w_q of r(x) = r_c + L sum_q w_q t(theta(x_q)), by point.
  Array Arm(double x) const;
  // N_k(x) by column, `width` of them.
  Array ShapesAt(double x) const;

  int modes = 0;
  Ends ends;
  int count = 0;   // p, shapes
  int points = 0;  // Q, Gauss points; a multiple of 4
  int width = 0;   // count + 1 padded: columns of the tables
  Array x;         // of the points [-]
  Array weight;    // of the points [-]
  Array shape;     // N_k(x_q), Q x width [-]
  // int_0^1 G(x, x_q) G(x, x_q') dx (of dx, the part of the mass) with the weights of both: the
  // kinetic energy of a rod of mass m relative to its centre is m L^2 / 2 sum_qq' kernel theta_q'
  // theta_q'' cos(theta_q - theta_q').
  Array kernel;     // Q x Q [-]
  Array stiffness;  // int_0^1 N_k'^2 dx, times the stiffness over that at the start, width [-]

 private:
  int KindOf(int k) const;
  double RawShape(int k, double x) const;  // k from 0
  double RawSlope(int k, double x) const;
  void Diagonalize();

  data::BeamSection section_;
  std::shared_ptr<const TaperedShapes> tapered_;  // null: the section does not change
  Array centre_;  // means over the mass of what Arm integrates, of a changing section; by degree

  Array mix_;  // N_k = sum_j mix_[(k - 1) count + j] raw_j
};

}  // namespace unfurl::sim
