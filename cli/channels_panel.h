#pragma once

#include "data/fit.h"
#include "report/page.h"

namespace unfurl::cli {

// What instruments recorded, over the model at the estimate behind each of them, and what is left.
void AddChannels(const data::FitRecord& record, report::Page* page);

}  // namespace unfurl::cli
