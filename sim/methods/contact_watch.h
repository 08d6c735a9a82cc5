#pragma once

#include <vector>

#include "sim/methods/path_watch.h"

namespace unfurl::sim {

// Whether a step that was tried, and found good by its estimate, has a kink of a contact's law
// between its ends that matters: where the force comes to be held at zero, or comes back, and where
// the transition zone ends. Neither of an estimate's two sums has it where it is.
class ContactWatch {
 public:
  ContactWatch(const Model& model, const ErrorScale& scale) : model_(model), scale_(scale) {}

  bool empty() const { return model_.latches.count() == 0; }
  // Of the step of h [s] between two motions, in these modes: the part that ends at the first such
  // kink; 1: there is none. `beams` is of a right side that is not far away.
  double Part(const Motion& start, const Motion& end, double h, const std::vector<LatchMode>& modes,
              const KirchhoffBeams::Work& beams) const;

 private:
  double PartOf(int k, bool upper, const JointPath& path, double weight) const;

  const Model& model_;
  const ErrorScale scale_;
};

}  // namespace unfurl::sim
