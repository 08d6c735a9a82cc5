#pragma once

#include <memory>
#include <string>
#include <vector>

#include "correlate/sampled_model.h"
#include "study/effects.h"
#include "study/fit_study.h"
#include "study/sized_effects.h"

namespace unfurl::study {

/// A study with an effect switched, ready for correlate::Refits: each trial has one model to search
/// with and, as its only rung, the one that is meant; none where they are the same.
struct EffectVersion {
  BoundStudy binding;
  std::vector<std::string> released;  ///< parameters that go with the effect
  /// It is searched for with the study's own lowest rung, of which nothing tells beforehand how the
  /// version differs from it.
  bool look_first = false;
};

/// Versions of a fitted study. The finest rung is what such a study means, so a finer mesh is finer
/// than that. What the finest rung adds to the lowest one at the estimate is added to versions that
/// leave the mesh as it is; the others have no ladder.
class EffectVersions {
 public:
  /// Both must outlive it; the fit must be usable. Costs a run of the lowest and of the finest rung
  /// for each trial of a study with a ladder.
  EffectVersions(const data::Study& study, const StudyFit& as_is);

  /// As EffectsOf, of the scene as its finest rung has it.
  std::vector<EffectSwitch> Effects(bool each) const;
  /// As SizedEffectsOf, likewise.
  std::vector<SizedEffect> Sized(bool each) const;
  /// With nothing switched.
  EffectVersion AsItIs() const { return Switched({}, true); }
  /// `there`: the effect is in the scene. Throws Error where the scene does not take it.
  EffectVersion Switched(const std::vector<std::string>& set, bool there) const;

 private:
  struct Motions {
    std::shared_ptr<const correlate::SampledModel> coarse, fine;
  };
  // Not every trial has its own: no ladder, or a rung that failed.
  bool HasLadder() const { return motions_.size() == as_is_.problem().trials.size(); }
  // Else a finest rung that could not be evaluated left the fit to the lowest.
  bool MeansFinest() const { return HasLadder() || as_is_.problem().trials.front().rungs.empty(); }
  void OnOneRung(EffectVersion* out) const;

  data::Study study_;
  const StudyFit& as_is_;
  std::vector<Motions> motions_;  // by trial
};

}  // namespace unfurl::study
