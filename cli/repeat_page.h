#pragma once

#include <string>

#include "data/fit.h"

namespace unfurl::cli {

// The page of a fit of many trials that scatter: each trial's values beside the mean and the next
// one's, and the band of the next one's marks.
void WriteRepeatPage(const std::string& path, const data::FitRecord& record,
                     const data::Provenance& provenance);

}  // namespace unfurl::cli
