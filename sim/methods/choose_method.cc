#include "sim/methods/choose_method.h"

#include <algorithm>
#include <cmath>

#include "sim/methods/make_stepper.h"

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

constexpr double kLongestStep = 0.01;  // of the time scale; see SimulateOptions::max_step

bool BeamsAreStiff(const Model& model, double rtol) {
  const double overdamped = kOverdamped * std::pow(rtol / kAtTolerance, kPower);
  const Bending& bending = model.bending;
  for (int e = 0; e < bending.bodies(); ++e) {
    if (bending.shear_stiffness(e) == 0.0) continue;
    // The lighter neighbour; stations have no mass of their own.
    const double a = model.rigid_bodies.mass[e], b = model.rigid_bodies.mass[e + 1];
    const double mass = a == 0.0 || b == 0.0 ? std::max(a, b) : std::min(a, b);
    const double bend = kBendingRate * std::sqrt(bending.shear_stiffness(e) / mass);
    const double stretch = 2.0 * std::sqrt(bending.axial_stiffness(e) / mass);
    if (bending.damping(e) * bend > overdamped || stretch > kAxialOverBending * bend) return true;
  }
  return false;
}

}  // namespace

double LongestStep(const SimulateOptions& options, const Model& model) {
  return options.max_step > 0.0 ? options.max_step : kLongestStep * model.time_scale;
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
Method ChooseMethod(const SimulateOptions& options, const Model& model) {
  if (options.method != Method::kAuto) return options.method;
  if (options.order != 0) return Method::kProjected;
  const bool smooth = model.kirchhoff.count() > 0;
  const bool implicit = smooth
                            ? model.kirchhoff.stretches()
                            : options.rtol >= kImplicitTolerance && !model.constraints.HasLoops() &&
                                  BeamsAreStiff(model, options.rtol);
  return implicit ? Method::kImplicit : Method::kProjected;
}

bool StrainsForbidExplicit(const Model& model, const ErrorScale& scale) {
  const double off = scale.rtol * scale.length;  // [m]
  double held = 0.0;
  for (const Model::Beam& beam : model.beams) {
    if (beam.smooth < 0) continue;
    held = std::max(held, 0.5 * beam.EA * off * off / (beam.segments * beam.segment_length));
  }
  return held > 0.0 && held > scale.rtol * EnergyScale(model, scale);
}

}  // namespace unfurl::sim
