// Curves under a verb's words, in characters.
#pragma once

#include <string>
#include <vector>

#include "data/fit.h"
#include "sim/model/model.h"

namespace unfurl::cli {

// Whether standard output is a terminal, where curves are drawn unasked.
bool OnTerminal();

// Quantities of a run to be drawn: by the names asked for (* and ? stand for letters; "none": none
// of them), which must be among those kept; without, on a terminal, angles of joints, or else places
// of marks, a few. Throws Error for a name that there is not, before anything has run.
std::vector<std::string> PlottedQuantities(const sim::Model& model,
                                           const std::vector<std::string>& asked,
                                           const std::vector<std::string>& kept);

// Those of a run that is written.
std::string RunPlots(const std::string& run, const std::vector<std::string>& quantities);

// What a fit leaves, in sigmas, sample by sample; without marks nothing.
std::string ResidualPlot(const data::FitRecord& fit);

}  // namespace unfurl::cli
