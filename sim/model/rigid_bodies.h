#pragma once

#include <algorithm>
#include <vector>

#include "sim/model/aligned.h"

namespace unfurl::sim {

// Rigid bodies of the equations of motion are known by their index, here called `body`. Those of
// one beam are neighbours: a station where its start is welded, its segments, a station where its
// end is welded. Then come the scene's bodies (those welded together are one) and the ground. So
// the elements of all beams are one loop over neighbouring indices; pairs that are not elements
// have zero stiffness. The amplitudes of a smooth beam take places among them, three to a body.

// A point of a rigid body that a beam is welded to: it moves with the body and has no mass.
struct Station {
  int index = -1;      // its own, among the bodies
  int body = -1;       // that carries it
  double px = 0.0;     // in the body's frame, from its centre of mass [m]
  double py = 0.0;     // [m]
  double angle = 0.0;  // of the beam's axis against the body's [rad]
};

struct RigidBodies {
  int count = 0;       // all bodies, padded to a multiple of kBlock
  int beam_count = 0;  // bodies of beams, padded alike; element e joins bodies e and e + 1
  int ground = -1;
  // By body; zero for stations, padding and the ground.
  Array mass;             // [kg]
  Array inertia;          // [kg m^2]
  Array inverse_mass;     // [1/kg]
  Array inverse_inertia;  // [1/(kg m^2)]
  std::vector<Station> stations;
  // Bodies attached to a smooth beam, by beam: their motion is filled in from the beam's
  // coordinates and its compliance couples them, so their inverse masses are zero here too.
  std::vector<std::vector<int>> attached;
  // Bodies that hold amplitudes of a smooth beam, rising.
  std::vector<int> amplitudes;

  // Whether the body holds coordinates that are integrated.
  bool IsDynamic(int body) const {
    return inverse_mass[static_cast<std::size_t>(body)] > 0.0 ||
           std::binary_search(amplitudes.begin(), amplitudes.end(), body);
  }
};

// A state vector holds, one after another, x, y, theta of all bodies, their rates, and what is
// integrated beside: kExtras energies. Element loops read entry n of a block, at zero stiffness.
inline constexpr int kExtraContact = 0;  // dissipated in contacts [J]
inline constexpr int kExtraBeams = 1;    // dissipated in beams [J]
inline constexpr int kExtraDampers = 2;  // dissipated in dampers and by friction [J]
inline constexpr int kExtraWork = 3;     // done by drives, motors and applied forces [J]
inline constexpr int kExtrasUsed = 4;    // those above
inline constexpr int kExtras = kBlock;

struct StateIndex {
  int n = 0;  // RigidBodies::count
  int x(int body) const { return body; }
  int y(int body) const { return n + body; }
  int theta(int body) const { return 2 * n + body; }
  int vx(int body) const { return 3 * n + body; }
  int vy(int body) const { return 4 * n + body; }
  int omega(int body) const { return 5 * n + body; }
  int extra(int k) const { return 6 * n + k; }
  int size() const { return 6 * n + kExtras; }
};

struct LatchMode;

// Positions and rates by body, with cosine and sine of theta.
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
  bool held = false;                 // time stands still: drives keep their place
  // By latch: springs that hold a pressed stop's level from both sides, in place of its contact's
  // law, while an equilibrium is looked for [N/m]; null: the laws.
  const double* holding = nullptr;
};

// Forces [N] and moments about the body's own point [N m].
struct Load {
  double* fx;
  double* fy;
  double* m;
};

}  // namespace unfurl::sim
