#pragma once

#include <string>

#include "sim/methods/simulate.h"
#include "sim/model/model.h"

namespace unfurl::sim {

// One line about a run that will take long: how long, what its steps are limited by and where, and
// what would shorten it. `seconds`: in all [s]; `report`: so far.
std::string AboutSlowRun(const Model& model, const SimulateOptions& options,
                         const SimulateReport& report, double seconds);

}  // namespace unfurl::sim
