#pragma once

#include <string>

#include "data/provenance.h"
#include "sim/record/run_summary.h"

namespace unfurl::cli {

// The page of a run: what happened in words, latches and loads, the motion, energies, what it cost.
// Reads the run's file, thinned to what a picture shows.
void WriteSimulatePage(const std::string& path, const sim::SummaryInput& input,
                       const data::Provenance& provenance);

}  // namespace unfurl::cli
