#pragma once

#include "sim/dynamics/dynamics.h"
#include "sim/implicit/equilibrium_report.h"

namespace unfurl::sim {

// Lets the state at rest slide to where no acceleration is left, with the modes of the latches held
// as they are: implicit steps of pseudo-time without velocities, each solved by Newton's
// iterations,
//   M (q - q_before) = b M a(q),   phi(q) = 0,
// that grow as they are easily solved and end as Newton's steps of the equilibrium. Rigid motions
// stay where they are. `y` is changed also when nothing is found.
EquilibriumReport FindEquilibrium(Dynamics* dynamics, double* y);

// Presses every latch on the stop that its load pushes it against, if on any, and finds the
// equilibrium; the modes of the latches are set. The state starts near that.
EquilibriumReport FindLatchedEquilibrium(Dynamics* dynamics, double* y);

}  // namespace unfurl::sim
