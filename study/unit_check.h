#pragma once

#include <span>
#include <string>

#include "correlate/observations.h"
#include "study/scene_model.h"

namespace unfurl::study {

/// Throws Error, placed at `tracks`, where a trial's times or lengths are in another unit than
/// seconds and metres by what the scene does: a simulation of a record of milliseconds taken for
/// seconds would take a thousand times as long before anything was noticed. Costs one run of the
/// scene's own duration where the record is more than thirty times as long, or the marks' places at
/// first differ by powers of a thousand; else next to nothing.
void RefuseOtherUnits(const correlate::Observations& record, const SceneModel& model,
                      std::span<const double> theta, const std::string& tracks);

}  // namespace unfurl::study
