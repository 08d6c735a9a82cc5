#pragma once

#include <vector>

#include "study/trial_effects.h"

namespace unfurl::study {

/// Of a probability: what verdicts ask, 100 to 1 [-].
inline constexpr double kSure = 0.99;

/// By what the effects of a trial are judged.
struct EffectJudge {
  double part = 0.3;      ///< as TrialEffectsOptions [-]
  double rows = 1.0;      ///< of data that both fits answer for [-]
  bool explained = true;  ///< the fit as it is explains its data
};

/// That the effect is in the trial, by Schwarz's approximation of Bayes' factor for a rise of
/// -2 log likelihood by `deviance` without it: a parameter more costs log(rows) [Schwarz 1978].
double ProbabilityOfEffect(double deviance, double rows, const TrialEffect& effect);

/// Fills verdict and message of an effect that was fitted.
void JudgeEffect(const EffectJudge& judge, TrialEffect* effect);

/// Where the trial contradicts one effect of the scene, or misses one that the scene has not, or is
/// fitted better without one than with any value of the parameters that go with it, the others were
/// weighed beside a wrong model: what is not needed there may be needed in the right one. Such
/// verdicts become "cannot be told".
void DoubtBesideOthers(std::vector<TrialEffect>* effects);

}  // namespace unfurl::study
