#pragma once

#include <vector>

#include "sim/dynamics/dynamics.h"

namespace unfurl::sim {

// One motion q(t) = shape exp(s t) of the system linearised about a state at rest,
//   M q'' + D q' + K q = J^T mu,   J q = 0.
struct NaturalMode {
  double frequency = 0.0;  // undamped, omega / (2 pi) [Hz]; 0 for a rigid or unstable one
  double growth = 0.0;     // of an unstable motion: sqrt(-omega^2) [1/s]
  double damping = 0.0;    // ratio, to first order in D [-]
  // dx, dy of all bodies' points and their dtheta, three blocks; the largest displacement is 1 m
  // (or the largest angle 1 rad where nothing is displaced) [m], [rad].
  std::vector<double> shape;
};

struct ModesReport {
  int rigid = 0;                   // motions without stiffness, or below rigid_below
  double rigid_below = 0.0;        // rounding hides what is slower [Hz]; 0: it hides nothing
  double rounding = 0.0;           // largest error of a frequency that it leaves, of itself
  std::vector<NaturalMode> modes;  // unstable ones first, then by frequency; rigid ones left out
};

enum class ModesSolver { kAuto, kDense, kSubspace };

// The lowest `count` modes about the state `y` at rest, with the tangents of the last RightSide
// there. Small systems are solved densely on the null space of J; large ones by subspace iteration
// with (M + b K)^-1 on the constraints, O(n) an iteration.
ModesReport FindModes(Dynamics* dynamics, double* y, int count,
                      ModesSolver solver = ModesSolver::kAuto);

}  // namespace unfurl::sim
