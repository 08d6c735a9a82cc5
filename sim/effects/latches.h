#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "data/scene.h"
#include "sim/effects/contact_law.h"
#include "sim/effects/effect.h"
#include "sim/model/hinge.h"

namespace unfurl::sim {

// What of a latch does not follow from the state. It is held fixed within a step, so that the right
// side is smooth there and a trial stage may overshoot a stop; the events change it.
struct LatchMode {
  std::uint8_t latched = 0;        // has closed; never reopens
  std::uint8_t upper_contact = 0;  // the upper stop (at theta_a) is being pressed
  std::uint8_t lower_contact = 0;  // the lower stop (at -theta_b)
};

// Locking joints with clearance and contact, [paper, eq. (14) to (25)] as docs/physics-simulator.md
// has them. A stop that is passed by an angle is pressed in by delta = x_p theta_c; the contact's
// law gives the force (contact_law.h). Reads the modes of the motion.
class Latches {
 public:
  static constexpr EffectText kText = {"latches", "contact",
                                       "energy stored in the latches' contacts"};
  static constexpr PowerKind kPower = PowerKind::kContact;

  using Contact = ContactLaw::Contact;
  // An end of the clearance: passed where side (theta - level) > 0.
  struct Stop {
    double side;   // 1: the upper stop; -1: the lower [-]
    double level;  // of theta [rad]
  };

  void Add(const Hinge& hinge, const data::SceneLatch& latch, const data::SceneContact& contact);
  int count() const { return static_cast<int>(latches_.size()); }
  const Hinge& hinge(int k) const { return at(k).hinge; }
  const ContactLaw& law(int k) const { return at(k).law; }
  Stop StopOf(int k, bool upper) const { return at(k).stops[upper ? 0 : 1]; }

  double Depth(int k, double angle) const {
    return at(k).lever * angle;
  }  // of it behind a stop [m]

  // Contact on the upper or lower stop at angle theta and its rate, were the stop active.
  Contact At(int k, bool upper, double theta, double theta_rate) const {
    const Latch& latch = at(k);
    const Stop stop = StopOf(k, upper);
    return latch.law.At(latch.lever * (stop.side * (theta - stop.level)),
                        latch.lever * (stop.side * theta_rate));
  }

  // The same of a spring that holds the stop's level, from both sides [N/m].
  Contact Held(int k, bool upper, double theta, double stiffness) const;

  bool HasPower() const { return count() > 0; }
  void AddLoad(const Motion& motion, Load load, double* dissipated) const;
  // Piecewise, by the modes as the load is.
  void AddTangent(const Motion& motion, Tangent* tangent) const;
  // What contacts still have whose force is not held at zero [J].
  double Energy(const Motion& motion) const;
  double EnergyScale(const Motion& motion) const { return Energy(motion); }
  // What the held ones have: it never comes back, and counts as dissipated [J].
  double HeldEnergy(const Motion& motion) const;
  double Moment(int k, const Motion& motion, const LatchMode& mode) const;  // on theta [N m]

 private:
  struct Latch {
    Hinge hinge;
    Stop stops[2];  // upper, lower
    double lever;   // x_p [m]
    ContactLaw law;
  };
  const Latch& at(int k) const { return latches_[static_cast<std::size_t>(k)]; }
  // Calls visit(stop, contact) for every stop of latch k that is pressed.
  template <typename Visit>
  void ForEachPressed(int k, const Motion& motion, Visit&& visit) const;
  double Sum(const Motion& motion, bool held) const;

  std::vector<Latch> latches_;
};

}  // namespace unfurl::sim
