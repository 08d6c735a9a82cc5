#pragma once

#include <string>
#include <vector>

#include "correlate/hierarchy/from_fits.h"
#include "correlate/hierarchy/next_trial.h"
#include "data/fit.h"
#include "study/repeat.h"

namespace unfurl::study {

/// What each trial's own record holds of its samples, noise and evaluations, one after another.
/// Starts, profiles and looks at finer meshes stay in the trials' own records.
data::FitRecord JoinRecords(const data::Study& study, const std::vector<StudyFit>& trials);

/// The values over all trials, their scatter, and the next trial, in the parameters' units.
void AddHierarchy(const std::vector<correlate::Parameter>& parameters,
                  const correlate::FittedTrials& fitted, const correlate::Hierarchy& hierarchy,
                  data::FitRecord* record);
/// Of the next trial's marks at the stamps.
void AddNextTrial(const correlate::Stamps& stamps, const correlate::NextTrial& next,
                  data::FitRecord* record);

/// The verdict and its reasons in words, from the numbers above. `bend` as in NextTrial.
void JudgeRepeat(const correlate::FittedTrials& fitted, const correlate::NextTrial& next,
                 data::FitRecord* record);

}  // namespace unfurl::study
