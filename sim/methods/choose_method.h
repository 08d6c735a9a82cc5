#pragma once

#include "sim/methods/simulate.h"
#include "sim/model/model.h"

namespace unfurl::sim {

struct ErrorScale;

// What `auto` stands for: `implicit` where beams are stiff by damping or stretching and the
// tolerance is one that a fourth order meets cheaply, where smooth beams stretch, where strains
// of the tolerance hold more than its part of the energy of the start (StrainEnergyAtTolerance,
// without closed loops), or where nothing moves and nothing will, else `projected`;
// docs/decisions/012-implicit.md, 243-smooth-beams-stretch.md. Other methods stand for themselves.
Method ChooseMethod(const SimulateOptions& options, const Model& model, const ErrorScale& scale);
// What strains of elastic beams as large as the tolerance hold, of the beam where it is most [J].
// Explicit steps leave such strains at the edge of their stability. Where they hold more than the
// tolerance allows of what moves they do not die out, and whatever comes next has to resolve them:
// explicit steps are then held to a tighter one.
double StrainEnergyAtTolerance(const Model& model, const ErrorScale& scale);

// The longest step that the options allow, or their default allows with this model [s].
double LongestStep(const SimulateOptions& options, const Model& model);

// The tolerance of a companion whose difference to a run at `rtol` tells the run's error of time
// stepping: kTighter of what the run's steps are held to, which is bounded from above
// (ToleranceOf); of what is asked alone it could be that of the run again. No smaller than rounding
// allows [-].
inline constexpr double kTighter = 0.1;
double TighterTolerance(double rtol);

}  // namespace unfurl::sim
