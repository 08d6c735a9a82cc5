#pragma once

#include <functional>
#include <string>
#include <vector>

#include "data/scene.h"
#include "data/study.h"
#include "study/fit_study.h"
#include "study/trial_effects.h"

namespace unfurl::study {

/// An effect that a scene lacks and could have, of a size that only a trial can tell.
struct SizedEffect {
  std::string name;               ///< "dampers of the joints"
  std::string unit;               ///< of the size
  std::vector<std::string> keys;  ///< of the scene, that get the size
  std::vector<std::string> set;   ///< overrides that come with it
  double first = 0.0;             ///< next to nothing for this scene: where a search begins
  bool either_sign = false;       ///< its size may be negative
};

/// Springs, dampers, quadratic dampers and friction where no joint of that kind has one (revolute
/// joints and sliders for themselves; springs at rest where the joints start), clearance of latches
/// that have none, damping of beams that have none, gravity along x and y where there is none.
/// `each`: as EffectsOf. Without those of which the study fits a key.
std::vector<SizedEffect> SizedEffectsOf(const data::Scene& scene, const data::Study& study,
                                        bool each = false);

/// Fits the study with the effect, at sizes that a parabola of the deviance leads to: its vertex is
/// the size, its curvature the size's standard error. `weigh`: fits with these overrides and
/// judges, as for an absent effect of known size. `rows`: of data [-]. Fills `effect`, whose size
/// is 0 where none above fits better.
void WeighSized(const SizedEffect& sized, double rows,
                const std::function<void(const std::vector<std::string>&, TrialEffect*)>& weigh,
                TrialEffect* effect);

/// Where the study as it is does not explain its trials: fits it anew with each of those effects
/// whose size the data prefer to none by 100 to 1, the size being one more parameter. One with
/// which the model explains them is needed, with the size that this fit gives.
void FitMissing(const data::Study& study, const FitStudyOptions& options,
                const std::vector<SizedEffect>& sized, std::vector<TrialEffect>* effects);

/// Each was weighed against none of them: what one of them does in the trial, others take for
/// theirs. Needed stays the one that leaves least, if by 100 to 1; else it cannot be told which.
/// `rows`: of data [-].
void DoubtRivals(double rows, std::vector<TrialEffect>* effects);

}  // namespace unfurl::study
