#pragma once

#include <utility>

#include "correlate/compare/comparison.h"

namespace unfurl::correlate {

// The measures of a comparison whose signals are filled in; each fills its own part of it.

// Per mark, per body's angle, and over all marks: errors, energies, the objective rating.
void FillScores(Comparison* c);
// Amplitude spectra with peaks, densities with coherence, operating shapes at the shared peaks.
void FillSpectra(const ComparisonOptions& options, Comparison* c);
// In place of the peaks of one long transform, which of what noise drives is all speckle, those of
// averaged densities: of the record, of the reference, or of both; after FillSpectra.
void UseDensityPeaks(const ComparisonOptions& options, bool record, bool reference, Comparison* c);
// Modes of both from the same stretch as the spectra.
void FillModes(const ComparisonOptions& options, Comparison* c);
// Samples [first, last) of a signal that lie within the window of the spectra.
std::pair<std::size_t, std::size_t> WithinSpectra(const Comparison& c, const ComparedSignal& s);
// Reasons about modes, peaks, and what limits a comparison, in words.
void AddModeReasons(Comparison* c);
void AddPeakReasons(Comparison* c);

}  // namespace unfurl::correlate
