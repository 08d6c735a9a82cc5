#pragma once

#include <string>
#include <vector>

#include "correlate/compare/comparison.h"

namespace unfurl::cli {

// The paper's comparison of a trial with its simulation as pictures for a report, in `folder` (made
// if need be): figure-15.svg, the turn of the central body, from two marks on it; figure-16a.svg
// and figure-16b.svg, the displacements of the two marks that move most; figure-17.svg, the spectra
// of the one that moves most. What a trial cannot show is left out. Gives what was written, in
// words.
std::string WritePaperFigures(const std::string& folder, const correlate::Comparison& comparison);

// The names of all files that it may write.
std::vector<std::string> PaperFigureNames();

}  // namespace unfurl::cli
