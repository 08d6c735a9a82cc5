#pragma once

#include "sim/methods/simulate.h"
#include "sim/model/model.h"

namespace unfurl::sim {

// What `auto` stands for: `implicit` where beams are stiff by damping or stretching and the
// tolerance is one that a fourth order meets cheaply, else `projected`;
// docs/decisions/012-implicit.md. Other methods stand for themselves.
Method ChooseMethod(const SimulateOptions& options, const Model& model);

// The longest step that the options allow, or their default allows with this model [s].
double LongestStep(const SimulateOptions& options, const Model& model);

// The tolerance of a companion whose difference to a run at `rtol` tells the run's error of time
// stepping: kTighter of what the run's steps are held to, which is bounded from above
// (ToleranceOf); of what is asked alone it could be that of the run again. No smaller than rounding
// allows [-].
inline constexpr double kTighter = 0.1;
double TighterTolerance(double rtol);

}  // namespace unfurl::sim
