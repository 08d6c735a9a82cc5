#pragma once

#include <cstdint>
#include <vector>

#include "sim/model/hinge.h"

namespace unfurl::sim {

class Tangent;

// What of a latch does not follow from the state. It is held fixed within a step, so that the right
// side is smooth there and a trial stage may overshoot a stop; the events change it.
struct LatchMode {
  std::uint8_t latched = 0;        // has closed; never reopens
  std::uint8_t upper_contact = 0;  // the upper stop (at theta_a) is being pressed
  std::uint8_t lower_contact = 0;  // the lower stop (at -theta_b)
};

// Locking joints with clearance and contact, [paper, eq. (14) to (25)] as docs/physics-simulator.md
// has them: delta = x_p theta_c, f = K delta^1.5 + C T(delta) d(delta)/dt, never pulling
// (selectable).
class Latches {
 public:
  struct Law {
    double theta_a = 0.0;  // [rad]
    double theta_b = 0.0;  // [rad]
    double lever = 0.0;    // x_p [m]
    double K = 0.0;        // [N/m^1.5]
    double C = 0.0;        // [N s/m]
    double Q = 0.0;        // [-]
    double epsilon = 0.0;  // [m]
    bool never_pulls = true;
  };

  struct Contact {
    double depth = 0.0;       // delta [m]; <= 0: apart
    double depth_rate = 0.0;  // [m/s]
    double force = 0.0;       // f [N]
    double elastic = 0.0;     // K delta^1.5 [N]
    double stored = 0.0;      // 2/5 K delta^2.5 [J]
    bool held = false;        // f is held at zero with delta > 0
  };

  void Add(const Hinge& hinge, const Law& law);
  int count() const { return static_cast<int>(hinges_.size()); }
  const Hinge& hinge(int k) const { return hinges_[k]; }
  const Law& law(int k) const { return laws_[k]; }

  // Contact on the upper or lower stop at angle theta and its rate, were the stop active.
  Contact At(int k, bool upper, double theta, double theta_rate) const;

  void AddLoad(const Motion& motion, const std::vector<LatchMode>& modes, Load load,
               double* dissipated) const;
  // Piecewise, by the modes as the load is.
  void AddTangent(const Motion& motion, const std::vector<LatchMode>& modes,
                  Tangent* tangent) const;
  double Moment(int k, const Motion& motion, const LatchMode& mode) const;  // of contact, on theta
  // Energy in the contacts [J]; what a held contact still has counts as `lost` instead.
  double Stored(const Motion& motion, const std::vector<LatchMode>& modes, double* lost) const;

 private:
  std::vector<Hinge> hinges_;
  std::vector<Law> laws_;
};

}  // namespace unfurl::sim
