#include "sim/effects/latches.h"

#include "sim/implicit/tangent.h"

namespace unfurl::sim {

void Latches::Add(const Hinge& hinge, const data::SceneLatch& latch,
                  const data::SceneContact& contact) {
  latches_.push_back(
      {hinge, {{1.0, latch.theta_a}, {-1.0, -latch.theta_b}}, latch.lever, ContactLaw(contact)});
}

template <typename Visit>
void Latches::ForEachPressed(int k, const Motion& motion, Visit&& visit) const {
  const LatchMode mode = motion.modes[k];
  if (!(mode.upper_contact | mode.lower_contact)) return;
  const double theta = hinge(k).Theta(motion), rate = hinge(k).Rate(motion);
  for (const bool upper : {true, false}) {
    if (!(upper ? mode.upper_contact : mode.lower_contact)) continue;
    visit(StopOf(k, upper), motion.holding == nullptr ? At(k, upper, theta, rate)
                                                      : Held(k, upper, theta, motion.holding[k]));
  }
}

void Latches::AddLoad(const Motion& motion, Load load, double* dissipated) const {
  for (int k = 0; k < count(); ++k) {
    ForEachPressed(k, motion, [&](const Stop& stop, const Contact& c) {
      hinge(k).Apply(-stop.side * at(k).lever * c.force, load);
      if (dissipated != nullptr) *dissipated += (c.force - c.elastic) * c.depth_rate;
    });
  }
}

void Latches::AddTangent(const Motion& motion, Tangent* tangent) const {
  for (int k = 0; k < count(); ++k) {
    const double arm = at(k).lever * at(k).lever;
    double stiffness = 0.0, damping = 0.0;
    ForEachPressed(k, motion, [&](const Stop&, const Contact& c) {
      stiffness += arm * c.by_depth;
      damping += arm * c.by_rate;
    });
    // Pressed or not: the tangent's pattern does not depend on the modes.
    tangent->AddHinge(hinge(k), stiffness, damping);
  }
}

Latches::Contact Latches::Held(int k, bool upper, double theta, double stiffness) const {
  const Stop stop = StopOf(k, upper);
  Contact c;
  c.depth = at(k).lever * (stop.side * (theta - stop.level));
  c.force = c.elastic = stiffness * c.depth;
  c.stored = 0.5 * c.force * c.depth;
  c.by_depth = stiffness;
  return c;
}

double Latches::Sum(const Motion& motion, bool held) const {
  double sum = 0.0;
  for (int k = 0; k < count(); ++k) {
    ForEachPressed(k, motion, [&](const Stop&, const Contact& c) {
      if (c.held == held) sum += c.stored;
    });
  }
  return sum;
}

double Latches::Energy(const Motion& motion) const { return Sum(motion, false); }
double Latches::HeldEnergy(const Motion& motion) const { return Sum(motion, true); }

double Latches::Moment(int k, const Motion& motion, const LatchMode& mode) const {
  const double theta = hinge(k).Theta(motion), rate = hinge(k).Rate(motion);
  double moment = 0.0;
  for (const bool upper : {true, false}) {
    if (!(upper ? mode.upper_contact : mode.lower_contact)) continue;
    moment -= StopOf(k, upper).side * at(k).lever * At(k, upper, theta, rate).force;
  }
  return moment;
}

}  // namespace unfurl::sim
