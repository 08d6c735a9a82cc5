#pragma once

#include <optional>
#include <string>
#include <vector>

#include "correlate/align/align.h"
#include "correlate/compare/explanations.h"
#include "correlate/compare/metrics.h"
#include "correlate/compare/objective_rating.h"
#include "correlate/compare/signal_metrics.h"
#include "correlate/modes/identify.h"
#include "correlate/spectra/spectral_density.h"
#include "data/run.h"
#include "data/tracks.h"

namespace unfurl::correlate {

// What `correlate` finds: two records beside each other, as numbers for JSON, terminal and page.

/// What a compared history is of: one coordinate of a mark, the angle of a body that carries two
/// marks, or a channel. Names are for people; this is what the code asks.
struct SignalId {
  /// What the history is of.
  enum class Kind { kCoordinate, kAngle, kChannel };
  Kind kind = Kind::kCoordinate;
  std::size_t mark = 0;    ///< index into Comparison::marks; of an angle, the first of the two; of
                           ///< a channel, into Comparison::channels
  std::size_t second = 0;  ///< of an angle alone: the other
  int axis = 0;            ///< of a coordinate alone: 0, 1, 2 for x, y, z of the model's frame
  std::string unit{};      ///< of a channel alone, the readings'; empty: not told

  bool IsAngle() const { return kind == Kind::kAngle; }             ///< of a body
  bool IsCoordinate() const { return kind == Kind::kCoordinate; }   ///< of a mark
  bool IsChannel() const { return kind == Kind::kChannel; }         ///< of an instrument
  bool InPlane() const { return IsCoordinate() && axis < 2; }       ///< x or y
  bool AcrossPlane() const { return IsCoordinate() && axis == 2; }  ///< z
  /// Of the values.
  const char* Unit() const { return IsChannel() ? unit.c_str() : IsAngle() ? "rad" : "m"; }
  bool operator==(const SignalId&) const = default;
};

// One scalar in time, of both, in id.Unit().
struct ComparedSignal {
  SignalId id;
  std::string name;                                // "angle of mark1-mark1b", "mark3 y", "gyro"
  std::vector<double> t;                           // on the record's clock [s]
  std::vector<double> measured, sigma, reference;  // of a record alone there is no reference
};

// Their spectra over one window, with peaks that belong together.
struct ComparedSpectrum {
  SignalId id;
  std::string name;
  Spectrum measured, reference;
  std::vector<Peak> measured_peaks, reference_peaks;
  std::vector<PeakPair> pairs;
  /// Of what noise drives: peaks are those of `density`, and their amplitudes root mean squares.
  bool by_density = false;
  double frac = -1.0;     // frequency response assurance; below 0: not computed [-]
  CrossSpectrum density;  // no segments: too short
  std::string note;       // of gaps
};

// How alike two histories are; "test" is what was measured, or the reference where both are alike.
struct ComparedScore {
  /// What the score is of.
  enum class Of { kMark, kAngle, kAll, kChannel };
  Of of = Of::kMark;  // a mark's x and y together, an angle, all marks, or a channel
  std::string name;
  std::string unit{};  ///< of a channel alone
  /// Of the values in the score.
  const char* Unit() const {
    return of == Of::kChannel ? unit.c_str() : of == Of::kAngle ? "rad" : "m";
  }
  // Of what moved since the reference's first sample; of a channel as it was read.
  SignalScore score;
  double sigmas = 0.0;  // RMS error in the marks' own sigmas; 0: unknown [-]
  bool rated = false;   // whether there is a rating: enough even samples
  ObjectiveRating rating;
  double rating_step = 0.0;  // of the samples rated [s]
};

// The deformation at a frequency that both show.
struct OperatingShape {
  double measured_frequency = 0.0, reference_frequency = 0.0;  // [Hz]
  double amplitude = 0.0;                                      // largest measured [m]
  double mac = 0.0;                                            // [-]
};

/// A channel of the record, and what it is held against.
struct ComparedChannel {
  std::string name, unit;
  std::string of;  ///< the channel or quantity of the reference; empty: a record alone
};

/// Two records beside each other; or one alone, without a reference.
struct Comparison {
  std::string record, reference;  // file names; no reference: the record alone
  bool record_is_run = false, reference_is_run = false;
  bool record_is_test = true;  // which of the two is the benchmark of the scores
  std::vector<std::string> marks;
  std::vector<std::string> left_out;      // marks or channels that only one of them has
  std::vector<ComparedChannel> channels;  ///< instead of marks
  Observations observations;
  Alignment alignment;
  std::vector<MarkError> errors;      // per mark, then "all"
  std::vector<ComparedScore> scores;  // angles, marks, then "all"
  std::vector<ComparedSignal> signals;
  std::vector<ComparedSpectrum> spectra;
  double spectrum_from = 0.0, spectrum_to = 0.0;  // on the record's clock [s]
  std::vector<OperatingShape> operating_shapes;
  std::vector<std::string> mode_signals;
  /// Of the modes' amplitudes in them; all "1", over each signal's own RMS, where the signals'
  /// units differ.
  std::vector<std::string> mode_units;
  ModalFit measured_modes, reference_modes;
  /// How it was decided what each record's vibration is, in words; whether it is ambient, and then
  /// what the record is worth.
  std::string measured_vibration, reference_vibration;
  bool measured_doubtful = false, reference_doubtful = false;  // Identification::doubtful
  std::optional<AmbientFit> measured_ambient, reference_ambient;
  std::vector<ModePair> mode_pairs;
  // Where the modes' part of the spectra's window ends, if before it, on the record's clock [s].
  std::optional<double> modes_until;
  std::vector<ModelEvent> latches;        // of a run, on its own clock
  std::vector<Explanation> explanations;  // of marks' distances, in the reasons too
  std::string verdict;
  std::vector<std::string> reasons;
};

// The coordinate of a mark; null: not there.
const ComparedSignal* FindCoordinate(const Comparison& c, std::size_t mark, int axis);

/// What is compared, and how.
struct ComparisonOptions {
  std::vector<std::string> marks;  // empty: those that both have
  // Of spectra and modes, on the record's clock [s]; unset: from the last latch, to the end.
  std::optional<double> from, to;
  SpectralWindow window = SpectralWindow::kHann;
  bool clock_drift = false;  // whether the record's clock may run at another rate
  /// What the record's vibration is; the reference's is by the data, but for a decay asked for.
  Excitation modes = Excitation::kByTheData;
  // What is known of the record's clock and frame beforehand; what is unsaid is found, the drift
  // where `clock_drift` says so.
  Placement placement;
};

/// One side of a comparison: a run, or tracks. Points to what the caller keeps.
struct ComparedRecord {
  ComparedRecord(const data::Run& r, std::string n = "a run") : run(&r), name(std::move(n)) {}
  ComparedRecord(const data::Tracks& t, std::string n = "tracks")
      : tracks(&t), name(std::move(n)) {}
  const std::vector<std::string>& marks() const;  ///< names

  const data::Run* run = nullptr;  ///< exactly one of the two
  const data::Tracks* tracks = nullptr;
  std::string name;  ///< for messages and reports
};

/// Aligns `record` with `reference` in time and frame, then compares errors, scores, spectra and
/// modes of the marks that both have. Throws Error for records without a mark in common; a failed
/// alignment is a status of the result.
Comparison Compare(const ComparedRecord& record, const ComparedRecord& reference,
                   const ComparisonOptions& options = {});

// Each path is a run, or tracks in any of their forms (data/formats.h). Throws Error for anything
// else and for records without a mark in common.
Comparison Compare(const std::string& record, const std::string& reference,
                   const ComparisonOptions& options = {});

// The same for what is in memory already. `c` holds the names, marks, observations and latches.
void CompareWith(const SampledModel& reference, const ComparisonOptions& options, Comparison* c);

}  // namespace unfurl::correlate
