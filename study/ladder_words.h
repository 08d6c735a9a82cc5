#pragma once

#include "correlate/fit/fit.h"
#include "data/fit.h"

namespace unfurl::study {

// Adds to the reasons which rungs were climbed, how far the last step was, and what went up.
void AddLadderWords(const correlate::LadderResult& ladder, data::FitRecord* record);

}  // namespace unfurl::study
