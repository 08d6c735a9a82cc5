#include "sim/effects/latches.h"

#include <cmath>

namespace unfurl::sim {

void Latches::Add(const Hinge& hinge, const Law& law) {
  hinges_.push_back(hinge);
  laws_.push_back(law);
}

Latches::Contact Latches::At(int k, bool upper, double theta, double theta_rate) const {
  const Law& law = laws_[k];
  Contact c;
  c.depth = law.lever * (upper ? theta - law.theta_a : -theta - law.theta_b);
  c.depth_rate = law.lever * (upper ? theta_rate : -theta_rate);
  if (!(c.depth > 0.0)) return c;
  c.elastic = law.K * c.depth * std::sqrt(c.depth);
  c.stored = 0.4 * c.elastic * c.depth;
  const double T =
      c.depth < law.epsilon ? std::exp(2.0 * (c.depth - law.epsilon) * law.Q / law.epsilon) : 1.0;
  c.force = c.elastic + law.C * T * c.depth_rate;
  if (law.never_pulls && c.force < 0.0) {
    c.force = 0.0;
    c.held = true;
  }
  return c;
}

void Latches::AddLoad(const Motion& motion, const std::vector<LatchMode>& modes, Load load,
                      double* dissipated) const {
  for (int k = 0; k < count(); ++k) {
    const LatchMode mode = modes[k];
    if (!(mode.upper_contact | mode.lower_contact)) continue;
    const double theta = hinges_[k].Theta(motion);
    const double rate = hinges_[k].Rate(motion);
    double moment = 0.0;
    for (const bool upper : {true, false}) {
      if (!(upper ? mode.upper_contact : mode.lower_contact)) continue;
      const Contact c = At(k, upper, theta, rate);
      moment += (upper ? -laws_[k].lever : laws_[k].lever) * c.force;
      if (dissipated != nullptr) *dissipated += (c.force - c.elastic) * c.depth_rate;
    }
    hinges_[k].Apply(moment, load);
  }
}

double Latches::Moment(int k, const Motion& motion, const LatchMode& mode) const {
  const double theta = hinges_[k].Theta(motion);
  const double rate = hinges_[k].Rate(motion);
  double moment = 0.0;
  if (mode.upper_contact) moment -= laws_[k].lever * At(k, true, theta, rate).force;
  if (mode.lower_contact) moment += laws_[k].lever * At(k, false, theta, rate).force;
  return moment;
}

double Latches::Stored(const Motion& motion, const std::vector<LatchMode>& modes,
                       double* lost) const {
  double stored = 0.0;
  for (int k = 0; k < count(); ++k) {
    for (const bool upper : {true, false}) {
      if (!(upper ? modes[k].upper_contact : modes[k].lower_contact)) continue;
      const Contact c = At(k, upper, hinges_[k].Theta(motion), hinges_[k].Rate(motion));
      (c.held ? *lost : stored) += c.stored;
    }
  }
  return stored;
}

}  // namespace unfurl::sim
