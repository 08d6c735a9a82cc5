#pragma once

#include "data/fit.h"
#include "report/page.h"

namespace unfurl::cli {

// The rungs of a fit's ladder, what each cost, and the looks at the finest; nothing without one.
void AddLadder(const data::FitRecord& fit, report::Page* page);

}  // namespace unfurl::cli
