#pragma once

#include <string>
#include <vector>

#include "correlate/align.h"
#include "correlate/metrics.h"
#include "correlate/spectrum.h"

namespace unfurl::report {
class Page;
}

namespace unfurl::cli {

// What `correlate` finds: two records beside each other, as numbers for JSON, terminal and page.

// One scalar in time, of both.
struct ComparedSignal {
  std::string name;  // "angle of mark1-mark1b", "mark3 y"
  std::string unit;
  std::vector<double> t;  // on the record's clock [s]
  std::vector<double> measured, sigma, reference;
};

// Their spectra over one window, with peaks that belong together.
struct ComparedSpectrum {
  std::string name;
  correlate::Spectrum measured, reference;
  std::vector<correlate::Peak> measured_peaks, reference_peaks;
  std::vector<correlate::PeakPair> pairs;
  std::string note;  // of gaps
};

struct Comparison {
  std::string record, reference;  // file names
  bool reference_is_run = false;
  std::vector<std::string> marks;
  std::vector<std::string> left_out;  // marks that only one of them has
  correlate::Observations observations;
  correlate::Alignment alignment;
  std::vector<correlate::MarkError> errors;  // per mark, then "all"
  std::vector<ComparedSignal> signals;
  std::vector<ComparedSpectrum> spectra;
  double spectrum_from = 0.0, spectrum_to = 0.0;  // on the record's clock [s]
  std::vector<correlate::ModelEvent> latches;     // of a run, on its own clock
  std::string verdict;
  std::vector<std::string> reasons;
};

struct ComparisonOptions {
  std::vector<std::string> marks;  // empty: those that both have
  double from = 0.0, to = 0.0;     // of the spectra, on the record's clock [s]; equal: by itself
};

// Each path is a run or tracks (HDF5), or tracks as CSV. Throws Error for anything else and for
// records without a mark in common.
Comparison Compare(const std::string& record, const std::string& reference,
                   const ComparisonOptions& options);

// The same for what is in memory already. `c` holds the names, marks, observations and latches.
void CompareWith(const correlate::SampledModel& reference, const ComparisonOptions& options,
                 Comparison* c);

// Charts and tables of a comparison that succeeded, onto any page.
void AddComparisonPanels(const Comparison& comparison, report::Page* page);

// The page of it.
void WriteComparisonPage(const std::string& path, const Comparison& comparison,
                         const data::Provenance& provenance);

}  // namespace unfurl::cli
