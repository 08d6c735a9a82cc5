#pragma once

#include <vector>

namespace unfurl::sim {

struct Model;

// Constraints that follow from the others at the model's initial state, found by elimination
// (Partition). They are redundant where they still do, and are still met, when the mechanism has
// been moved a little in a direction of no special kind; else the state itself is singular, as the
// flat one of a parallelogram.
struct Redundancy {
  std::vector<int> rows;  // that can be left out
  bool singular = false;  // the initial state is; then rows are those without a pivot there
};
Redundancy FindRedundancy(const Model& model);

}  // namespace unfurl::sim
