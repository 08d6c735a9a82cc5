#pragma once

#include "correlate/compare/comparison.h"

namespace unfurl::correlate {

// The measures of a comparison whose signals are filled in; each fills its own part of it.

// Per mark, per body's angle, and over all marks: errors, energies, the objective rating.
void FillScores(Comparison* c);
// Amplitude spectra with peaks, densities with coherence, operating shapes at the shared peaks.
void FillSpectra(const ComparisonOptions& options, Comparison* c);
// Modes of both from the same stretch as the spectra.
void FillModes(Comparison* c);

}  // namespace unfurl::correlate
