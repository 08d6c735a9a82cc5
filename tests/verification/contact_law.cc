#include "contact_law.h"

#include <algorithm>
#include <cmath>

namespace unfurl::reference {

double ContactLaw::Depth(bool upper, double theta) const {
  return lever * (upper ? theta - theta_a : -theta - theta_b);
}

double ContactLaw::RawForce(bool upper, double theta, double rate) const {
  const double d = Depth(upper, theta);
  if (d <= 0.0) return 1.0;
  const double T = d < epsilon ? std::exp(2.0 * (d - epsilon) * Q / epsilon) : 1.0;
  return K * std::pow(d, 1.5) + C * T * lever * (upper ? rate : -rate);
}

double ContactLaw::Moment(bool latched, double theta, double rate) const {
  double moment = 0.0;
  if (latched && Depth(true, theta) > 0.0) {
    moment -= lever * std::max(0.0, RawForce(true, theta, rate));
  }
  if (Depth(false, theta) > 0.0) moment += lever * std::max(0.0, RawForce(false, theta, rate));
  return moment;
}

double ContactLaw::Branch(int which, double theta, double rate) const {
  const bool upper = which % 2 == 0;
  if (which < 2) return Depth(upper, theta);
  if (which < 4) return Depth(upper, theta) - epsilon;
  return RawForce(upper, theta, rate);
}

double ContactLaw::LargestStep(double theta, double rate) const {
  constexpr double kApart = 1e-4;  // a tenth of the shortest contact [s]
  for (const bool upper : {true, false}) {
    const double d = Depth(upper, theta);
    if (d <= 0.0 || d > 4.0 * epsilon) continue;
    return std::min(kApart, 0.02 * epsilon / (lever * std::max(std::fabs(rate), 1e-9)));
  }
  return kApart;
}

ContactLaw PaperLaw() {
  const double h_i = 0.91 / (M_PI * 2.01e11), h_j = 0.91 / (M_PI * 6.895e10);
  const double log_e = std::log(0.85);
  ContactLaw law;
  law.theta_a = law.theta_b = 0.0052;
  law.lever = 0.02;
  law.K = 4.0 / (3.0 * M_PI * (h_i + h_j)) * std::sqrt(0.005);
  law.C = 2.0 * 0.424 * std::sqrt(3.2e9 / 0.424) *
          std::sqrt(log_e * log_e / (log_e * log_e + M_PI * M_PI));
  law.Q = 3.0;
  law.epsilon = 5e-6;
  return law;
}

}  // namespace unfurl::reference
