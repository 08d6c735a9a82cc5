#include "sim/methods/choose_method.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "sim/dynamics/dynamics.h"
#include "sim/methods/make_stepper.h"
#include "sim/methods/run_judge.h"

namespace unfurl::sim {
namespace {

// The implicit method pays down to here: it is of fourth order (docs/decisions/012-implicit.md).
constexpr double kImplicitTolerance = 1e-7;
// Highest bending rate of a chain of segments over sqrt(12 EI / (l^3 m)), half elements included.
constexpr double kBendingRate = 4.6;
// From here on it is damping or stretching, not bending or contact, that limits an explicit step so
// much that an implicit one, three times as dear, pays. Its length falls with the tolerance while
// an explicit one's does not: measured on the deployment from 1e-3 to 1e-5.
constexpr double kOverdamped = 2.5, kAxialOverBending = 4.0;
constexpr double kAtTolerance = 1e-3, kPower = -0.25;

constexpr double kLongestMethodStep = 0.01;  // of the time scale; see SimulateOptions::max_step

// [1/s]; the lighter neighbour counts: stations have no mass of their own.
struct ElementRates {
  double bend = 0.0, stretch = 0.0;
};
ElementRates RatesOf(const Model& model, int e) {
  const double a = model.rigid_bodies.mass[e], b = model.rigid_bodies.mass[e + 1];
  const double mass = a == 0.0 || b == 0.0 ? std::max(a, b) : std::min(a, b);
  return {kBendingRate * std::sqrt(model.bending.shear_stiffness(e) / mass),
          2.0 * std::sqrt(model.bending.axial_stiffness(e) / mass)};
}

bool BeamsAreStiff(const Model& model, double rtol) {
  const double overdamped = kOverdamped * std::pow(rtol / kAtTolerance, kPower);
  const Bending& bending = model.bending;
  for (int e = 0; e < bending.bodies(); ++e) {
    if (bending.shear_stiffness(e) == 0.0) continue;
    const auto [bend, stretch] = RatesOf(model, e);
    if (bending.damping(e) * bend > overdamped || stretch > kAxialOverBending * bend) return true;
  }
  return false;
}

// Whether the longest step reaches the edge of stability along the imaginary axis, which is nearest
// for 5(4), at 1.
bool StretchingReachesTheEdge(const Model& model, double longest) {
  for (int e = 0; e < model.bending.bodies(); ++e) {
    if (model.bending.axial_stiffness(e) == 0.0) continue;
    if (RatesOf(model, e).stretch * longest > 1.0) return true;
  }
  return false;
}

// What will move is not known yet; what moves already is. Whether explicit steps pay is found while
// the run goes on.
bool StartIsHeldByStrains(const SimulateOptions& options, const Model& model,
                          const ErrorScale& scale) {
  const double held = StrainEnergyAtTolerance(model, scale);
  if (held == 0.0 || !StretchingReachesTheEdge(model, LongestStep(options, model))) return false;
  std::vector<double> start = model.initial_state;
  return held > scale.rtol * Dynamics(model).BalanceAt(0.0, start.data()).kinetic;
}

// Whether nothing moves, and within a time scale nothing will by more than the tolerance. What
// explicit steps then leave of the tolerance at the edge of stability is all that moves.
bool StartsAtRest(const Model& model, const ErrorScale& scale) {
  if (!IsClosed(model)) return false;
  std::vector<double> start = model.initial_state, rate(start.size());
  Dynamics(model).RightSide(0.0, start.data(), rate.data());
  const int n = model.rigid_bodies.count;
  for (int k = 3 * n; k < 6 * n; ++k) {
    const double allowed = scale.rtol * (k < 5 * n ? scale.speed : scale.spin);
    if (std::fabs(start[k]) > allowed || std::fabs(rate[k]) * model.time_scale > allowed) {
      return false;
    }
  }
  return true;
}

}  // namespace

double LongestStep(const SimulateOptions& options, const Model& model) {
  return options.max_step > 0.0 ? options.max_step : kLongestMethodStep * model.time_scale;
}

double TighterTolerance(double rtol) {
  constexpr double kTightest = 1e-13;  // rounding
  SimulateOptions options;
  options.rtol = rtol;
  return std::max(kTighter * ToleranceOf(options), kTightest);
}

// A smooth beam that stretches is stiff whatever it is made of, as lines are slender. An explicit
// start would put an error of the tolerance into the strain, which EA makes a force and work of; if
// the tolerance is so tight that explicit steps are faster, that is found while the run goes on.
Method ChooseMethod(const SimulateOptions& options, const Model& model, const ErrorScale& scale) {
  if (options.method != Method::kAuto) return options.method;
  if (options.order != 0) return Method::kProjected;
  const bool smooth = model.kirchhoff.count() > 0, tree = !model.constraints.HasLoops();
  const bool stiff =
      !smooth && tree && options.rtol >= kImplicitTolerance && BeamsAreStiff(model, options.rtol);
  const bool implicit = stiff || model.kirchhoff.stretches() ||
                        (tree && StartIsHeldByStrains(options, model, scale)) ||
                        StartsAtRest(model, scale);
  return implicit ? Method::kImplicit : Method::kProjected;
}

double StrainEnergyAtTolerance(const Model& model, const ErrorScale& scale) {
  const double off = scale.rtol * scale.length;  // [m]
  double held = 0.0;
  for (const Model::Beam& beam : model.beams) {
    double stiffness = 0.0;  // of what stretches by `off` each [N/m]
    if (beam.smooth >= 0) stiffness = beam.EA / (beam.segments * beam.segment_length);
    for (int e = beam.first; beam.smooth < 0 && e + 1 < beam.first + beam.segments; ++e) {
      stiffness += model.bending.axial_stiffness(e);
    }
    held = std::max(held, 0.5 * stiffness * off * off);
  }
  return held;
}

}  // namespace unfurl::sim
