#pragma once

#include <string>

#include "cli/simulate_summary.h"
#include "data/provenance.h"

namespace unfurl::cli {

// The page of a run: what happened in words, latches and loads, the motion, energies, what it cost.
// Reads the run's file, thinned to what a picture shows.
void WriteSimulatePage(const std::string& path, const SummaryInput& input,
                       const data::Provenance& provenance);

}  // namespace unfurl::cli
