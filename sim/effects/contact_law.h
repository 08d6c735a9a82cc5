#pragma once

#include <cmath>
#include <concepts>
#include <variant>

#include "data/scene.h"

namespace unfurl::sim {

// The force between two bodies that press on each other.
struct ContactForce {
  double force = 0.0;     // f, positive where it pushes them apart [N]
  double elastic = 0.0;   // the part of f that has a potential [N]
  double stored = 0.0;    // that potential [J]
  double by_depth = 0.0;  // df/d(depth) [N/m]
  double by_rate = 0.0;   // df/d(depth rate) [N s/m]
};

// A law of contact, made from the contact's scene record: the force where the depth is positive,
// and the depth below which a force that was held at zero may come back while the bodies part [m];
// 0: nowhere. Steps are kept from passing over that zone.
template <typename L>
concept ContactForceLaw = std::constructible_from<L, const data::SceneContact&> &&
    requires(const L& law, double depth, double depth_rate) {
  { law.At(depth, depth_rate) } -> std::same_as<ContactForce>;
  { law.ReturnDepth() } -> std::same_as<double>;
};

// Hertz's spring with a damper that grows over a transition zone, [paper, eq. (14) to (23)]:
//   f = K delta^1.5 + C T(delta) d(delta)/dt,
//   T = exp(2 (delta - epsilon) Q / epsilon) for delta < epsilon, then 1.
class RampedContact {
 public:
  explicit RampedContact(const data::SceneContact& c)
      : K_(c.K), C_(c.C), Q_(c.Q), epsilon_(c.epsilon) {}

  ContactForce At(double depth, double depth_rate) const {
    ContactForce f;
    f.elastic = K_ * depth * std::sqrt(depth);
    f.stored = 0.4 * f.elastic * depth;
    const bool zone = depth < epsilon_;
    const double T = zone ? std::exp(2.0 * (depth - epsilon_) * Q_ / epsilon_) : 1.0;
    const double slope = zone ? 2.0 * Q_ / epsilon_ * T : 0.0;  // dT/d(delta)
    f.force = f.elastic + C_ * T * depth_rate;
    f.by_depth = 1.5 * K_ * std::sqrt(depth) + C_ * slope * depth_rate;
    f.by_rate = C_ * T;
    return f;
  }
  double ReturnDepth() const { return epsilon_; }

 private:
  double K_;        // [N/m^1.5]
  double C_;        // [N s/m]
  double Q_;        // [-]
  double epsilon_;  // [m]
};

// Hertz's spring with damping in proportion to its force, so that the force has no jump where the
// contact begins or ends, [Hunt and Crossley 1975]:
//   f = K delta^1.5 (1 + a d(delta)/dt),   a = 1.5 alpha.
// A body that comes in at v leaves at e v, where a v (1 + e) = ln((1 + a v) / (1 - a e v)),
// whatever its mass and K; for slow impacts e = 1 - alpha v. f pulls only where the bodies part
// faster than 1 / a, which one that rebounds freely does not reach.
class HuntCrossley {
 public:
  explicit HuntCrossley(const data::SceneContact& c) : K_(c.K), factor_(1.5 * c.alpha) {}

  ContactForce At(double depth, double depth_rate) const {
    ContactForce f;
    f.elastic = K_ * depth * std::sqrt(depth);
    f.stored = 0.4 * f.elastic * depth;
    const double damped = 1.0 + factor_ * depth_rate;
    f.force = f.elastic * damped;
    f.by_depth = 1.5 * K_ * std::sqrt(depth) * damped;
    f.by_rate = f.elastic * factor_;
    return f;
  }
  double ReturnDepth() const { return 0.0; }  // the sign of the force follows the rate alone

 private:
  double K_;       // [N/m^1.5]
  double factor_;  // 1.5 alpha [s/m]
};

// The law that a contact's record names. To add one: its name and numbers in data::SceneContact,
// its keys in the reader, its class here (docs/extending.md).
class ContactLaw {
 public:
  explicit ContactLaw(const data::SceneContact& c) : law_(Make(c)), never_pulls_(c.never_pulls) {}

  struct Contact : ContactForce {
    double depth = 0.0;       // delta [m]; <= 0: apart
    double depth_rate = 0.0;  // [m/s]
    bool held = false;        // f is held at zero with delta > 0
  };
  Contact At(double depth, double depth_rate) const {
    Contact c;
    c.depth = depth;
    c.depth_rate = depth_rate;
    if (!(depth > 0.0)) return c;
    static_cast<ContactForce&>(c) = std::visit(
        [=](const ContactForceLaw auto& law) { return law.At(depth, depth_rate); }, law_);
    if (never_pulls_ && c.force < 0.0) {
      c.force = c.by_depth = c.by_rate = 0.0;
      c.held = true;
    }
    return c;
  }
  double ReturnDepth() const {
    return std::visit([](const ContactForceLaw auto& law) { return law.ReturnDepth(); }, law_);
  }

 private:
  using Law = std::variant<RampedContact, HuntCrossley>;
  static Law Make(const data::SceneContact& c) {
    switch (c.law) {
      case data::SceneContact::Law::kHuntCrossley:
        return HuntCrossley(c);
      case data::SceneContact::Law::kRamped:
        break;
    }
    return RampedContact(c);
  }

  Law law_;
  bool never_pulls_;
};

}  // namespace unfurl::sim
