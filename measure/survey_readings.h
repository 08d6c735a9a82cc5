#pragma once

#include <cstddef>

#include "data/survey.h"

namespace unfurl::measure {

// Finds the readings of a survey that came as raw lines: fills u_px and s_px (NaN where a camera
// saw nothing usable). The background is the mean of all dark lines of a camera. A survey that
// already has readings is left as it is.
void FindSurveyReadings(data::Survey* survey, std::size_t workers = 0);

}  // namespace unfurl::measure
