#pragma once

#include <functional>
#include <string>
#include <vector>

#include "data/study.h"
#include "study/effects.h"
#include "study/fit_study.h"

namespace unfurl::study {

/// How a study's effects are weighed.
struct TrialEffectsOptions {
  double part = 0.3;        ///< of a sigma: marks or parameters that move by less are not moved [-]
  bool each = false;        ///< each part for itself
  std::size_t workers = 0;  ///< model evaluations at a time; 0: one per core
  bool allow_programs = false;                               ///< as FitStudyOptions
  std::function<void(double, const std::string&)> progress;  ///< part done [0, 1]; may throw
  /// Throws Error naming the field.
  void Check() const;
};

/// What a trial says of an effect: the parameters fitted again without it, or with it.
struct TrialEffect {
  /// Of a parameter that stays.
  struct Shift {
    std::string name;
    double sigmas = 0.0;  ///< in standard errors of the fit as it is [-]
  };
  EffectSwitch effect;
  EffectVerdict verdict = EffectVerdict::kUnjudged;
  std::string message;                ///< of one that failed
  std::vector<std::string> released;  ///< parameters that go with it
  /// By how much -2 log likelihood rises without the effect (falls with one that was not there),
  /// by the noise of the fit as it is [-].
  double deviance = 0.0;
  double probability = 0.5;  ///< that the effect is in the trial, one against the other [0, 1]
  double change = 0.0;       ///< of the fitted marks and channels, RMS in their sigmas [-]
  std::vector<Shift> shifts;
  double seconds = 0.0;  ///< of the fit
};

/// What a trial's effects count for.
struct TrialEffects {
  StudyFit fit;                       ///< as the study says
  double seconds = 0.0;               ///< of it
  std::vector<TrialEffect> effects;   ///< as EffectsOf
  std::vector<std::string> left_out;  ///< names: of the reduced scene
  std::vector<std::string> set;       ///< its overrides
  double reduced_change = 0.0;        ///< of the fit with all of these out, as TrialEffect::change
};

/// Fits the study as it is, and again with each effect of its scene switched: what parameters can
/// imitate is no evidence. Needed: the data prefer it by 100 to 1. Not needed: they do not prefer
/// it, and neither the fitted motion nor a parameter moves by more than a part of its error.
/// Contradicted: they prefer to be without it by 100 to 1. Else it cannot be told by this trial.
/// Of a fit that is not usable
/// nothing is told (fit.Usable()). Throws Error for bad input, a study of a program.
TrialEffects WeighTrialEffects(const data::Study& study, const TrialEffectsOptions& options);

}  // namespace unfurl::study
