#pragma once

#include <string>
#include <vector>

#include "correlate/align.h"
#include "correlate/metrics.h"
#include "correlate/modal_id.h"
#include "correlate/objective_rating.h"
#include "correlate/signal_metrics.h"
#include "correlate/spectral_density.h"

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
  double frac = -1.0;                // frequency response assurance; below 0: not computed
  correlate::CrossSpectrum density;  // no segments: too short
  std::string note;                  // of gaps
};

// How alike two histories are; "test" is what was measured, or the reference where both are alike.
struct ComparedScore {
  std::string name;  // a mark (its x and y together), an angle, or "all"
  std::string unit;
  correlate::SignalScore score;  // of what moved since the reference's first sample
  double sigmas = 0.0;           // RMS error in the marks' own sigmas; 0: unknown
  bool rated = false;            // whether there is a rating: enough even samples
  correlate::ObjectiveRating rating;
  double rating_step = 0.0;  // of the samples rated [s]
};

// The deformation at a frequency that both show.
struct OperatingShape {
  double measured_frequency = 0.0, reference_frequency = 0.0;  // [Hz]
  double amplitude = 0.0;                                      // largest measured [m]
  double mac = 0.0;
};

struct Comparison {
  std::string record, reference;  // file names
  bool record_is_run = false, reference_is_run = false;
  bool record_is_test = true;  // which of the two is the benchmark of the scores
  std::vector<std::string> marks;
  std::vector<std::string> left_out;  // marks that only one of them has
  correlate::Observations observations;
  correlate::Alignment alignment;
  std::vector<correlate::MarkError> errors;  // per mark, then "all"
  std::vector<ComparedScore> scores;         // angles, marks, then "all"
  std::vector<ComparedSignal> signals;
  std::vector<ComparedSpectrum> spectra;
  double spectrum_from = 0.0, spectrum_to = 0.0;  // on the record's clock [s]
  std::vector<OperatingShape> operating_shapes;
  std::vector<std::string> mode_signals;
  correlate::ModalFit measured_modes, reference_modes;
  std::vector<correlate::ModePair> mode_pairs;
  std::vector<correlate::ModelEvent> latches;  // of a run, on its own clock
  std::string verdict;
  std::vector<std::string> reasons;
};

struct ComparisonOptions {
  std::vector<std::string> marks;  // empty: those that both have
  double from = 0.0, to = 0.0;     // of the spectra, on the record's clock [s]; equal: by itself
  correlate::SpectralWindow window = correlate::SpectralWindow::kHann;
  bool clock_drift = false;  // whether the record's clock may run at another rate
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
