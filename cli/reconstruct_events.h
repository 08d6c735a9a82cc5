#pragma once

#include <string>
#include <vector>

#include "data/tracks.h"

namespace unfurl::cli {

// Times on the record's clock: listed, or a run's latches, by way of the run's alignment with the
// record.
std::vector<double> EventTimes(const std::string& events, const data::Tracks& tracks);

}  // namespace unfurl::cli
