#include "sim/methods/impact_watch.h"

#include <algorithm>

namespace unfurl::sim {
namespace {

// Steps of an impact, which add to its error.
constexpr double kStepsOfImpact = 10.0;  // [-]: order five, one tolerance each
// Of the way in: the way out of a stop that returns a quarter of the speed takes no longer.
constexpr double kLongestWayOut = 4.0;  // [-]

}  // namespace

double ImpactWatch::Weight(double t, const Motion& motion, const std::vector<LatchMode>& modes) {
  bool any = false;
  for (std::size_t k = 0; k < ways_.size(); ++k) {
    Way& way = ways_[k];
    const LatchMode mode = modes[k];
    if (!(mode.upper_contact | mode.lower_contact)) {
      way.pressed = false;
      continue;
    }
    if (!way.pressed) way = {true, false, t, t};
    if (!way.out) {
      const double rate = model_.latches.hinge(static_cast<int>(k)).Rate(motion);
      way.out = mode.upper_contact ? rate <= 0.0 : rate >= 0.0;
      way.turned = t;
    }
    any = any || t - way.turned <= kLongestWayOut * (way.turned - way.from);
  }
  return any ? kStepsOfImpact : 1.0;
}

}  // namespace unfurl::sim
