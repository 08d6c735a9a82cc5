#pragma once

namespace unfurl::sim {

/// How the search for a state at rest ended.
struct EquilibriumReport {
  bool found = false;
  int iterations = 0;
  /// What is left: the largest of x, y, and theta times the length scale [m/s^2].
  double acceleration = 0.0;
};

}  // namespace unfurl::sim
