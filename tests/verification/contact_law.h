#pragma once

namespace unfurl::reference {

// The contact law of a latch's two stops, written a second time from docs/physics-simulator.md,
// "Contact" ([paper, eq. (14) to (23)]; it does not pull).
struct ContactLaw {
  double theta_a = 0.0, theta_b = 0.0;  // [rad]
  double lever = 0.0;                   // [m]
  double K = 0.0;                       // [N/m^1.5]
  double C = 0.0;                       // [N s/m]
  double Q = 0.0;                       // [-]
  double epsilon = 0.0;                 // [m]

  double Depth(bool upper, double theta) const;  // [m]
  // Of one stop, before it is held at zero [N]; positive out of contact.
  double RawForce(bool upper, double theta, double rate) const;
  // On theta; the upper stop acts once latched [N m].
  double Moment(bool latched, double theta, double rate) const;
  // Quantities whose signs tell in which branch of the law a state is, 0 to kBranches - 1.
  static constexpr int kBranches = 6;
  double Branch(int which, double theta, double rate) const;
  // A step that leaps over none of them [s]: on the way out, where the force is held at zero, it
  // comes back for some microseconds within the transition zone.
  double LargestStep(double theta, double rate) const;
};

// The paper's numbers, section 5, worked out here from eq. (15), (16) and (19).
ContactLaw PaperLaw();

}  // namespace unfurl::reference
