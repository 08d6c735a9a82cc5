#include "reference.h"

#include <algorithm>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>

namespace unfurl::reference {

std::vector<Integrator::State> Integrator::Run(const RightSide& f, State y,
                                               const std::vector<double>& times) const {
  using Pair = boost::numeric::odeint::runge_kutta_fehlberg78<State>;
  Pair pair;
  const auto system = [&](const State& at, State& rate, double t) { f(t, at, rate); };
  State out(y.size()), whole(y.size()), middle(y.size());
  // Two half steps into `out`; their difference from a whole one, over what is allowed. (The pair's
  // own estimate vanishes where the right side hardly depends on y.)
  const auto step = [&](double t, double h) {
    pair.do_step(system, y, t, whole, h);
    pair.do_step(system, y, t, middle, 0.5 * h);
    pair.do_step(system, middle, t + 0.5 * h, out, 0.5 * h);
    double worst = 0.0;
    for (std::size_t i = 0; i < y.size(); ++i) {
      const double e = std::fabs(out[i] - whole[i]) / (tolerance * (1.0 + std::fabs(y[i])));
      if (!(e <= worst)) worst = e;
    }
    return worst;
  };
  const auto signs = [&](double t, const State& at) {
    std::vector<bool> positive;
    for (const Guard& g : guards) positive.push_back(g(t, at) > 0.0);
    return positive;
  };
  std::vector<State> states{y};
  double t = times.front(), h = 1e-6;
  for (std::size_t k = 1; k < times.size(); ++k) {
    while (t < times[k]) {
      double take = std::min({h, largest_step(y), times[k] - t});
      const bool to_the_end = take == times[k] - t;
      const double worst = step(t, take);
      if (!(worst <= 1.0)) {
        h = take * (std::isfinite(worst) ? std::max(0.2, 0.9 * std::pow(worst, -1.0 / 8.0)) : 0.2);
        continue;
      }
      const double grown = take * std::min(4.0, 0.9 * std::pow(std::max(worst, 1e-8), -1.0 / 8.0));
      const std::vector<bool> before = signs(t, y);
      if (signs(t + take, out) == before) {
        h = to_the_end ? std::max(h, grown) : grown;
        t = to_the_end ? times[k] : t + take;
        y = out;
        continue;
      }
      double low = 0.0;
      for (int i = 0; i < 60 && low < take; ++i) {
        const double half = 0.5 * (low + take);
        step(t, half);
        (signs(t + half, out) == before ? low : take) = half;
      }
      step(t, take);
      t += take;
      y = out;
      const std::vector<bool> after = signs(t, y);
      for (std::size_t g = 0; g < after.size(); ++g) {
        if (after[g] != before[g] && crossing) crossing(static_cast<int>(g), after[g], t, y);
      }
    }
    states.push_back(y);
  }
  return states;
}

std::vector<double> EvenTimes(double end, int n) {
  std::vector<double> times;
  for (int k = 0; k <= n; ++k) times.push_back(end * k / n);
  return times;
}

}  // namespace unfurl::reference
