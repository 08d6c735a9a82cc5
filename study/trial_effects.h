#pragma once

#include <functional>
#include <string>
#include <vector>

#include "correlate/fit/held_out.h"
#include "data/study.h"
#include "study/effects.h"
#include "study/fit_study.h"

namespace unfurl::study {

/// How a study's effects are weighed.
struct TrialEffectsOptions {
  double part = 0.3;  ///< of a sigma: marks or parameters that move by less are not moved [-]
  bool each = false;  ///< each part for itself
  /// Of the evaluations that the fit took: what each effect may take of the study's lowest rung,
  /// before it is left undecided. Versions cost more a run than the study does, and a few runs of
  /// the finest rung come on top, so that half of the fit's runs is one to two fits' time [-].
  double budget = 0.5;
  std::size_t workers = 0;      ///< model evaluations at a time; 0: one per core
  bool allow_programs = false;  ///< as FitStudyOptions
  std::function<void(double, const std::string&)> progress;  ///< part done [0, 1]; may throw
  /// Throws Error naming the option.
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
  /// Of one that the scene lacks and of which only the trial tells the size: that, its standard
  /// error, in `unit`; empty: it has none.
  double size = 0.0, size_sigma = 0.0;
  std::string unit;
  std::string message;                ///< of one that failed, or why nothing can be told
  std::vector<std::string> released;  ///< parameters that go with it
  bool fitted = false;                ///< there is a fit: what follows is told
  bool settled = false;               ///< it came to its end within the budget
  /// By how much -2 log likelihood rises without the effect (falls with one that was not there),
  /// by the noise of the fit as it is [-].
  double deviance = 0.0;
  /// Of it, what no values of the parameters take away, as far as the linear model at the end
  /// tells, and what the simulator's own scatter may have wrong [-].
  double deviance_least = 0.0, deviance_error = 0.0;
  double deviance_left = 0.0;  ///< by how much the fit as it is may still fall, likewise [-]
  /// Of the residuals' squares without the effect, what it takes away, parameters fitted [0, 1].
  double share = 0.0;
  double left = 0.0;         ///< mean square of the whitened residuals with it switched [-]
  double probability = 0.5;  ///< that the effect is in the trial, one against the other [0, 1]
  double change = 0.0;       ///< of the fitted marks and channels, RMS in their sigmas [-]
  /// By how much `change` is uncertain with the parameters that go with the effect [-].
  double change_sigma = 0.0;
  double change_rms = 0.0;  ///< of the fitted marks, RMS [m]
  /// By how much stretches of the record are predicted better, from all others, with the effect
  /// than without it.
  correlate::PredictiveGain held_out;
  std::vector<Shift> shifts;
  std::vector<std::string> latches;  ///< in words: those that come at another time, or not at all
  std::size_t runs = 0, looks = 0;   ///< evaluations: to search with, and of what is meant
  double seconds = 0.0;              ///< of CPU, that it took [s]
  double saved = 0.0;                ///< of a run's time, without the effect; negative: costs [-]
};

/// What a trial's effects count for.
struct TrialEffects {
  StudyFit fit;                       ///< as the study says
  double seconds = 0.0;               ///< of CPU, of it [s]
  std::vector<TrialEffect> effects;   ///< as EffectsOf, then as SizedEffectsOf
  std::vector<std::string> left_out;  ///< names: of the reduced scene
  std::vector<std::string> set;       ///< its overrides
  double reduced_change = 0.0;        ///< of the fit with all of these out, as TrialEffect::change
};

/// Fits the study as it is, and from there again with each effect of its scene switched: what
/// parameters can imitate is no evidence (correlate::Refits). Needed: the data prefer it by 100 to
/// 1. Not needed: they do not prefer it, and neither the fitted motion, at 95%, nor a parameter
/// moves by more than a part of its error. Contradicted: they prefer to be without it by 100 to 1.
/// Else it cannot be told by this trial, or not within the budget. Of a fit that does not explain
/// the data, only what takes 99% of the residuals' squares is needed, and nothing else is told;
/// beside an effect that is contradicted or missed, nothing is called not needed. Of a fit that is
/// not usable nothing is told (fit.Usable()). Throws Error for bad input, a study of a program.
TrialEffects WeighTrialEffects(const data::Study& study, const TrialEffectsOptions& options);

}  // namespace unfurl::study
