#pragma once

#include <memory>

#include "sim/dynamics/dynamics.h"
#include "sim/methods/simulate.h"
#include "sim/methods/stepper.h"
#include "sim/model/model.h"

namespace unfurl::sim {

// The stepper of a method, of the order that the options ask for or that costs least at their
// tolerance. `method`: anything but kAuto.
std::unique_ptr<Stepper> MakeStepper(const SimulateOptions& options, Dynamics& dynamics,
                                     const ErrorScale& scale, Method method);
// The order of the explicit pair: 4, 5 or 8.
int PairOrder(const SimulateOptions& options);

// The relative tolerance that steps are held to [-]: what is asked, bounded from above.
double ToleranceOf(const SimulateOptions& options);

// What errors of a step are measured against, from the scene's scales and its energy at the start.
ErrorScale ScaleOf(const Model& model, const SimulateOptions& options);
// Of energies, whether or not they are integrated [J].
double EnergyScale(const Model& model, const ErrorScale& scale);

}  // namespace unfurl::sim
