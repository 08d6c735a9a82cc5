#pragma once

#include <optional>
#include <vector>

#include "correlate/hierarchy/hierarchy.h"
#include "study/fit_study.h"

namespace unfurl::study {

/// A fit of many trials of one structure whose deployments differ (docs/study.md, "Many trials").
struct RepeatFit {
  std::vector<StudyFit> trials;                   ///< each by itself
  std::optional<correlate::Hierarchy> hierarchy;  ///< none: fewer than three trials count
  data::FitRecord record;                         ///< of all, verdicts in words
  data::Provenance provenance;
  /// Whether mean and scatter are there.
  bool Usable() const { return hierarchy.has_value(); }
};

/// Fits each trial of a study by itself and what they say together, and writes the record where
/// `output` is set. As Fit; Error too for a study of fewer than three trials. Evaluations are kept
/// in OUTPUT.trial-N.partial, a file a trial, until the record is written.
RepeatFit FitRepeat(const data::Study& study, const FitStudyOptions& options = {});

}  // namespace unfurl::study
