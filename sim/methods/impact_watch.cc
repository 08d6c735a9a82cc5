#include "sim/methods/impact_watch.h"

#include <algorithm>
#include <cmath>

namespace unfurl::sim {
namespace {

// Steps of an impact, which add to its error.
constexpr double kStepsOfImpact = 10.0;  // [-]: order five, one tolerance each
// Of the rate at which a stop is reached, an error of each of them: what the stop returns is then
// known to a tenth.
constexpr double kOfOwnRate = 0.01;  // [-]
constexpr double kTightest = 1e-13;  // rtol that a run may ask for [-]
// Of the way in: the way out of a stop that returns a quarter of the speed takes no longer.
constexpr double kLongestWayOut = 4.0;  // [-]

}  // namespace

double ImpactWatch::WeightAt(double rate, const Hinge& hinge, const Motion& motion) const {
  const double spin =
      std::max(std::fabs(motion.omega[hinge.inner]), std::fabs(motion.omega[hinge.outer]));
  const double tolerance = scale_.rtol * (scale_.spin + spin);
  const double own = kOfOwnRate * std::fabs(rate);
  // One that is pressed at rest, as at a run's start, is not hit; and nothing is held to less than
  // the tightest tolerance that there is.
  if (!(own > 0.0)) return 1.0;
  return std::max(kStepsOfImpact, std::min(tolerance / own, scale_.rtol / kTightest));
}

double ImpactWatch::Weight(double t, const Motion& motion, const std::vector<LatchMode>& modes) {
  double weight = 1.0;
  for (std::size_t k = 0; k < ways_.size(); ++k) {
    Way& way = ways_[k];
    const LatchMode mode = modes[k];
    if (!(mode.upper_contact | mode.lower_contact)) {
      way.pressed = false;
      continue;
    }
    const Hinge& hinge = model_.latches.hinge(static_cast<int>(k));
    if (!way.pressed) way = {true, false, t, t, WeightAt(hinge.Rate(motion), hinge, motion)};
    if (!way.out) {
      const double rate = hinge.Rate(motion);
      way.out = mode.upper_contact ? rate <= 0.0 : rate >= 0.0;
      way.turned = t;
    }
    if (t - way.turned <= kLongestWayOut * (way.turned - way.from)) {
      weight = std::max(weight, way.weight);
    }
  }
  return weight;
}

}  // namespace unfurl::sim
