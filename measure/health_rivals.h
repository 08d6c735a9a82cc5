#pragma once

#include <vector>

#include "measure/health.h"

namespace unfurl::measure {

// Whether other cameras than those found explain the evidence as well: one, or several that were
// wrong at the same moment. Where they do, `faults` says that it cannot be told which; where others
// explain it and these do not, they take their place. Nothing is taken out of `evidence`.
void JudgeRivals(const HealthEvidence& evidence, const Triangulator& triangulator,
                 const HealthOptions& options, std::size_t marks, std::vector<Fault>* faults);

// How far each camera must have shifted since the calibration to be found in 9 of 10 such trials
// [px], by camera, were it alone tested (in 6 of 10 as it is sought among all: decision 282): what
// the other cameras and the calibration's errors leave unknown of it.
std::vector<double> ShiftsThatShow(const HealthEvidence& evidence, const Triangulator& triangulator,
                                   const HealthOptions& options, std::size_t marks);

}  // namespace unfurl::measure
