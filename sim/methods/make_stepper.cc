#include "sim/methods/make_stepper.h"

#include <algorithm>

#include "sim/implicit/esdirk.h"
#include "sim/methods/dormand_prince.h"
#include "sim/methods/dormand_prince8.h"
#include "sim/methods/partitioned.h"
#include "sim/methods/runge_kutta_43.h"

namespace unfurl::sim {
namespace {

// From here on the pair of order 8 costs less (docs/accuracy.md).
constexpr double kTightTolerance = 1e-7;
// And from here up that of order 4: its steps reach twice as far where undamped beams limit them,
// and contacts stay right at tolerances where Dormand-Prince's begin to chatter.
constexpr double kLooseTolerance = 3e-4;

// Steps are not looser than this. Stability limits explicit ones by then, so that nothing is
// gained, and what a looser tolerance lets pass in the fastest vibrations turns into heat that
// never was. Implicit ones gain a tenth, and pass errors in what is stiff that no mark shows and
// that are several times the largest load (docs/accuracy.md).
constexpr double kLoosest = 1e-3;

// Kinetic energy of all bodies at the floors of the velocities' scales [J].
double FloorEnergy(const Model& model, const ErrorScale& scale) {
  double sum = 0.0;
  for (int k = 0; k < model.rigid_bodies.count; ++k) {
    sum += model.rigid_bodies.mass[k] * scale.speed * scale.speed +
           model.rigid_bodies.inertia[k] * scale.spin * scale.spin;
  }
  return 0.5 * sum;
}

}  // namespace

int PairOrder(const SimulateOptions& options) {
  if (options.order != 0) return options.order;
  if (options.rtol >= kLooseTolerance) return 4;
  return options.rtol <= kTightTolerance ? 8 : 5;
}

std::unique_ptr<Stepper> MakeStepper(const SimulateOptions& options, Dynamics& dynamics,
                                     const ErrorScale& scale, Method method) {
  const int order = PairOrder(options);
  if (method == Method::kPartitioned) {
    if (order == 4) return std::make_unique<Partitioned<RungeKutta43>>(dynamics, scale);
    return std::make_unique<Partitioned<DormandPrince>>(dynamics, scale);
  }
  if (method == Method::kImplicit) {
    return std::make_unique<Esdirk>(dynamics, scale, Ark436());
  }
  if (order == 4) return std::make_unique<RungeKutta43>(dynamics, scale);
  if (order == 8) return std::make_unique<DormandPrince8>(dynamics, scale);
  return std::make_unique<DormandPrince>(dynamics, scale);
}

double ToleranceOf(const SimulateOptions& o) { return std::min(o.rtol, kLoosest); }

ErrorScale ScaleOf(const Model& model, const SimulateOptions& o) {
  ErrorScale scale;
  scale.rtol = ToleranceOf(o);
  scale.length = o.length;
  scale.angle = 1.0;
  scale.speed = scale.length / o.time;
  scale.spin = 1.0 / o.time;
  if (o.track_energy) scale.energy = EnergyScale(model, scale);
  return scale;
}

double EnergyScale(const Model& model, const ErrorScale& scale) {
  std::vector<double> start = model.initial_state;
  const Balance b = Dynamics(model).BalanceAt(0.0, start.data());
  // No less than what goes with the speeds below which velocities are not distinguished either: a
  // scene may start without energy.
  return b.Scale() + FloorEnergy(model, scale);
}

}  // namespace unfurl::sim
