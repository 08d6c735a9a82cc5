#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "sim/methods/simulate.h"
#include "sim/methods/stepper.h"
#include "sim/model/model.h"

namespace unfurl::sim {

// Runs of a given course, and how far two runs are apart.

inline constexpr double kAnyError = 1e3;  // rtol at which steps of any size are taken

// The state after `steps` equal steps from 0 to `end` [s]; the stepper's rtol is kAnyError.
inline std::vector<double> Fixed(Stepper* stepper, const Model& model, double end, int steps) {
  stepper->Start(0.0, model.initial_state);
  for (int k = 1; k <= steps; ++k) {
    stepper->Try(end / steps);
    stepper->Accept(end * k / steps);
  }
  return {stepper->state(), stepper->state() + model.index.size()};
}

// The largest distance of a mark between two runs, over the samples that both have [m].
inline double FarthestApart(const MarkTracks& a, const MarkTracks& b, std::size_t mark) {
  double farthest = 0.0;
  for (std::size_t i = 0; i < std::min(a.t.size(), b.t.size()); ++i) {
    farthest =
        std::max(farthest, std::hypot(a.x[mark][i] - b.x[mark][i], a.y[mark][i] - b.y[mark][i]));
  }
  return farthest;
}

// Of any mark.
inline double FarthestApart(const MarkTracks& a, const MarkTracks& b) {
  double farthest = 0.0;
  for (std::size_t m = 0; m < a.x.size(); ++m)
    farthest = std::max(farthest, FarthestApart(a, b, m));
  return farthest;
}

}  // namespace unfurl::sim
