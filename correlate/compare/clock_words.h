#pragma once

#include <string>
#include <vector>

#include "correlate/compare/comparison.h"

namespace unfurl::correlate {

/// How the record's clock lies to the reference's, in sentences. `found`: from what, where it was
/// sought ("all channels together"); `then`: what followed, may be empty.
std::vector<std::string> ClockWords(const Comparison& comparison, const std::string& found,
                                    const std::string& then);

/// What was stated beforehand of clock and frame and the data contradict, a sentence each.
std::vector<std::string> ContradictionsOf(const Observations& observations, const Alignment& a);

}  // namespace unfurl::correlate
