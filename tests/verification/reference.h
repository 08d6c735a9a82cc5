#pragma once

#include <functional>
#include <vector>

namespace unfurl::reference {

// Integrates ordinary differential equations with Fehlberg's method of order 7 of Boost.Odeint,
// which the simulator does not use, two half steps against a whole one; right sides may jump where
// one of the guards changes sign: such places are bracketed to rounding by repeating the step with
// a smaller size, and the step ends just past them.
class Integrator {
 public:
  using State = std::vector<double>;
  using RightSide = std::function<void(double t, const State& y, State& dydt)>;
  using Guard = std::function<double(double t, const State& y)>;
  // Called just past a crossing, with the guard's index and its sign after it.
  using Crossing = std::function<void(int guard, bool positive, double t, State& y)>;

  double tolerance = 1e-14;  // of a step, relative to 1 + |y|, entry by entry
  // [s]; what happens between two guards' looks goes unseen, so it must be small where they change
  // fast.
  std::function<double(const State& y)> largest_step = [](const State&) { return 1e-2; };
  std::vector<Guard> guards;
  Crossing crossing;

  // The state at each of the times, which rise; `y` is the state at times[0].
  std::vector<State> Run(const RightSide& f, State y, const std::vector<double>& times) const;
};

// n + 1 times from 0 to `end`.
std::vector<double> EvenTimes(double end, int n);

}  // namespace unfurl::reference
