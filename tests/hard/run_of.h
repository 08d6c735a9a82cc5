#pragma once

#include <algorithm>
#include <cmath>

#include "sim/methods/simulate.h"

namespace unfurl::sim {

// Marks of a run at 100 samples a second; `order` 0: the program's choice.
inline MarkTracks RunOf(const Model& model, Method method, int order, double rtol) {
  SimulateOptions options;
  options.method = method;
  options.order = order;
  options.rtol = rtol;
  options.rate = 100.0;
  return SimulateMarks(model, options);
}

// The largest distance of a mark from itself in another run of as many samples [m].
inline double Apart(const MarkTracks& a, const MarkTracks& b) {
  double largest = 0.0;
  for (std::size_t m = 0; m < a.x.size(); ++m) {
    for (std::size_t k = 0; k < a.t.size(); ++k) {
      largest = std::max(largest, std::hypot(a.x[m][k] - b.x[m][k], a.y[m][k] - b.y[m][k]));
    }
  }
  return largest;
}

}  // namespace unfurl::sim
