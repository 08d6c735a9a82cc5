#pragma once

#include <algorithm>
#include <vector>

#include "sim/model/aligned.h"

namespace unfurl::sim {

// A slot is the index of a rigid body of the equations of motion. Those of one beam are neighbours:
// a station where its start is welded, its segments, a station where its end is welded. Then come
// the scene's bodies (those welded together are one) and the ground. So the elements of all beams
// are one loop over neighbouring indices; pairs that are not elements have zero stiffness.

// A point of a rigid body that a beam is welded to: it moves with the body and has no mass.
struct Station {
  int slot = -1;
  int body = -1;       // slot of the body
  double px = 0.0;     // in the body's frame, from its centre of mass [m]
  double py = 0.0;     // [m]
  double angle = 0.0;  // of the beam's axis against the body's [rad]
};

struct Slots {
  int count = 0;       // all slots, padded to a multiple of kBlock
  int beam_count = 0;  // slots of beams, padded alike; element e joins slots e and e + 1
  int ground = -1;
  // By slot; zero for stations, padding and the ground.
  Array mass;             // [kg]
  Array inertia;          // [kg m^2]
  Array inverse_mass;     // [1/kg]
  Array inverse_inertia;  // [1/(kg m^2)]
  std::vector<Station> stations;
  // Slots attached to a smooth beam, by beam: their motion is filled in from the beam's coordinates
  // and its compliance couples them, so their inverse masses are zero here too.
  std::vector<std::vector<int>> attached;
  // Slots that hold amplitudes of a smooth beam, rising.
  std::vector<int> amplitudes;

  // Whether the slot holds coordinates that are integrated.
  bool IsDynamic(int slot) const {
    return inverse_mass[static_cast<std::size_t>(slot)] > 0.0 ||
           std::binary_search(amplitudes.begin(), amplitudes.end(), slot);
  }
};

// A state vector holds, one after another, x, y, theta of all slots, their rates, and what is
// integrated beside: kExtras energies. Element loops read entry n of a block, at zero stiffness.
inline constexpr int kExtraContact = 0;  // dissipated in contacts [J]
inline constexpr int kExtraBeams = 1;    // dissipated in beams [J]
inline constexpr int kExtraDampers = 2;  // dissipated in dampers and by friction [J]
inline constexpr int kExtraWork = 3;     // done by drives, motors and applied forces [J]
inline constexpr int kExtrasUsed = 4;    // those above
inline constexpr int kExtras = kBlock;

struct StateIndex {
  int n = 0;  // Slots::count
  int x(int slot) const { return slot; }
  int y(int slot) const { return n + slot; }
  int theta(int slot) const { return 2 * n + slot; }
  int vx(int slot) const { return 3 * n + slot; }
  int vy(int slot) const { return 4 * n + slot; }
  int omega(int slot) const { return 5 * n + slot; }
  int extra(int k) const { return 6 * n + k; }
  int size() const { return 6 * n + kExtras; }
};

struct LatchMode;

// Positions and rates by slot, with cosine and sine of theta.
struct Motion {
  double t;  // [s]
  const double* x;
  const double* y;
  const double* theta;
  const double* vx;
  const double* vy;
  const double* omega;
  const double* c;
  const double* s;
  const LatchMode* modes = nullptr;  // by latch; null: no contact is evaluated
};

// Forces [N] and moments about the slot's own point [N m].
struct Load {
  double* fx;
  double* fy;
  double* m;
};

}  // namespace unfurl::sim
