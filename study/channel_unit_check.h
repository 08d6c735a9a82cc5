#pragma once

#include <span>

#include "correlate/observations.h"
#include "data/study.h"
#include "study/scene_model.h"

namespace unfurl::study {

/// Throws Error, placed at the channel, where its times or readings are in another unit than stated
/// by what the scene does over its own duration: milliseconds or minutes, degrees, millimetres. Not
/// where some parameter, at one of its bounds, makes up for it, nor, of the readings, where the
/// gain is to be found. Costs one run of the scene's duration, and two for each parameter where
/// there is doubt.
void RefuseOtherChannelUnits(const data::StudyTrial& trial,
                             const std::vector<data::StudyParameter>& parameters,
                             const correlate::Observations& record, const SceneModel& model,
                             std::span<const double> theta);

}  // namespace unfurl::study
