#pragma once

#include <string>

#include "campaign/rare.h"
#include "data/provenance.h"

namespace unfurl::cli {

// The probability of a rare failure, in words.
std::string RareText(const campaign::RareResult& result);

// The same with pictures of the levels. `record_path`: the file that holds the runs.
void WriteRarePage(const std::string& path, const campaign::RareResult& result,
                   data::Provenance provenance, const std::string& record_path);

}  // namespace unfurl::cli
