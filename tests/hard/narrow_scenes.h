#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace unfurl::sim {

// Of marks at 100 samples a second: by mark, by sample [m].
struct Tracks {
  std::vector<std::vector<double>> x, y;
};

// The largest distance of a mark from where it should be, over the range of its motion.
double PartApart(const Tracks& tracks, const Tracks& truth);

// A chain of one to three rigid bars on pins, from the ground or from a cart on a rail, with laws
// that are narrow in a state variable, drawn by its seed: dry friction with creep rates down to
// 1e-5 rad/s, snaps of moment tables down to 1e-3 rad wide, hard stops, springs whose ends pass one
// another at a distance of millimetres; many are released from rest.
struct NarrowScene {
  std::string toml;
  Tracks truth;
  double magnifies = 1.0;  // parts of the ranges per part that the start is off
  bool contains[4] = {};   // friction, table, stops, near spring
};

// The motion is that of the chain's Lagrange equations in the joints' angles, integrated by
// reference::Integrator.
NarrowScene DrawNarrowScene(std::uint64_t seed);

}  // namespace unfurl::sim
