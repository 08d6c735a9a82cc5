#pragma once

#include <string>
#include <vector>

#include "correlate/model.h"

namespace unfurl::study {

/// Latches of `b` that come at another time than in `a` (by more than `tell` [s]), or are gone, or
/// new, in words.
std::vector<std::string> LatchWords(const std::vector<correlate::ModelEvent>& a,
                                    const std::vector<correlate::ModelEvent>& b, double tell);

}  // namespace unfurl::study
