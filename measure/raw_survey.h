#pragma once

#include <functional>
#include <string>
#include <vector>

#include "data/raw_layout.h"
#include "data/survey_points.h"

namespace unfurl::measure {

// Readings of a survey's raw lines (layout.survey tells which line shows which of `points`): the
// spot of every lit line against the background of all dark ones, repeats averaged with their
// scatter (data::ReadingRepeats). The files are read twice, in constant memory. `progress` receives
// the share that is done. Throws Error as RawLines does, and for numbers of lines that do not fit
// the points, rows of survey.ids that are no id or slot, a point without a lit line, and lines of
// which none is dark.
data::ReadingTable ReadRawSurvey(const data::RawLayout& layout,
                                 const std::vector<std::string>& points,
                                 const std::function<void(double)>& progress);

}  // namespace unfurl::measure
