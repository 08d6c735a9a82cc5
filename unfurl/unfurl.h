#pragma once

/// Everything that a program needs of Unfurl. One call a step:
///
///     using namespace unfurl;
///     auto rig    = calib::Calibrate(data::ReadSurvey("survey.csv"));
///     auto tracks = measure::Reconstruct(data::TrialReader("trial.h5"), rig.rig);
///     auto run    = sim::Record(data::ReadScene("scene.toml"));
///     auto agree  = correlate::Compare(tracks, run.run);
///     auto fit    = study::Fit(data::ReadStudy("study.toml"));
///
/// What a person can mend throws unfurl::Error with its three parts; what numbers do is a status in
/// the result. SI units and radians; readings in pixels.

#include "base/error.h"
#include "base/progress.h"
#include "base/random.h"
#include "calib/calibrate_survey.h"
#include "calib/check.h"
#include "calib/plan.h"
#include "calib/wand.h"
#include "campaign/answers.h"
#include "campaign/in_process.h"
#include "correlate/compare/channel_comparison.h"
#include "correlate/compare/comparison.h"
#include "correlate/fit/fit.h"
#include "correlate/modes/identify.h"
#include "data/campaign.h"
#include "data/fit.h"
#include "data/lab.h"
#include "data/modes.h"
#include "data/rig.h"
#include "data/run.h"
#include "data/scene.h"
#include "data/study.h"
#include "data/survey.h"
#include "data/tracks.h"
#include "data/trial.h"
#include "measure/expose.h"
#include "measure/reconstruct.h"
#include "measure/trial_record.h"
#include "sim/implicit/find_modes.h"
#include "sim/methods/simulate.h"
#include "sim/record/record.h"
#include "study/fit_study.h"
#include "study/repeat.h"
#include "study/scene_cost.h"
