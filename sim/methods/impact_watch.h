#pragma once

#include <vector>

#include "sim/methods/stepper.h"
#include "sim/model/model.h"

namespace unfurl::sim {

// How much more exact than others a step is to be while a latch's stop is hit. An impact takes ten
// to twenty steps, which all err to one side, and the next impacts add to what it was off by: so
// what may be a tolerance off is the impact, not each of its steps. And a stop that is reached more
// slowly than the tolerance tells of is still to take what its law says of the rate, or it bounces
// for ever. Once it is pressed and nothing bounces any more, steps are as any others.
class ImpactWatch {
 public:
  ImpactWatch(const Model& model, const ErrorScale& scale)
      : model_(model), scale_(scale), ways_(model.latches.count()) {}

  bool empty() const { return ways_.empty(); }
  // By which a step's error counts more, from here on; 1: nothing is being hit. To be asked at the
  // start of every step.
  double Weight(double t, const Motion& motion, const std::vector<LatchMode>& modes);

 private:
  // Of a latch's stop since it was last reached.
  struct Way {
    bool pressed = false;
    bool out = false;                 // it has turned, and is on its way out
    double from = 0.0, turned = 0.0;  // [s]
    double weight = 1.0;              // [-]
  };

  double WeightAt(double rate, const Hinge& hinge, const Motion& motion) const;

  const Model& model_;
  const ErrorScale scale_;
  std::vector<Way> ways_;  // by latch
};

}  // namespace unfurl::sim
