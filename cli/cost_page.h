#pragma once

#include <string>

#include "correlate/fit/cost.h"
#include "data/provenance.h"

namespace unfurl::cli {

// The page of `unfurl cost`: the advice, error against time, every setting.
void WriteCostPage(const std::string& path, const std::string& scene,
                   const correlate::CostStudy& study, const data::Provenance& provenance);

// Rows for a table of settings, header first.
std::vector<std::vector<std::string>> CostRows(const correlate::CostStudy& study);

}  // namespace unfurl::cli
