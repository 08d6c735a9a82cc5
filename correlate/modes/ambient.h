#pragma once

#include <limits>
#include <span>
#include <string>
#include <vector>

#include "correlate/modes/modal_id.h"
#include "correlate/modes/steady_lines.h"

namespace unfurl::correlate {

/// How modes are looked for in the response to forces that nobody measured.
struct AmbientOptions {
  double low = 0.0;  ///< band to look in [Hz]; 0: ten periods in the record
  double high = std::numeric_limits<double>::infinity();  ///< [Hz]; and half of the slowest rate
  int max_order = 40;        ///< of the subspace method, in each part of the band; two per mode
  double max_damping = 0.5;  ///< ratio above which a pole is no mode of a structure [-]
  /// A pole is stable when the next lower order has one within these.
  double frequency_tolerance = 0.01;  ///< relative [-]
  double damping_tolerance = 0.2;     ///< relative, or 0.005 absolute [-]
  double shape_tolerance = 0.05;      ///< 1 - MAC [-]
  /// Part of the orders, from its first on, at which a cluster must be found to be a mode.
  double persistence = 0.5;  ///< [-]
  /// Chance at which what noise alone may show is believed; of each judge and each mode [-].
  double chance = 0.01;
};

/// A mode that is kept vibrating by forces nobody measured.
struct AmbientMode {
  /// Frequency, damping, shape and their standard errors; `amplitude` is its RMS in each signal,
  /// `share` that of the signals' variance, each over its own.
  Mode mode;
  double bandwidth_bins = 0.0;  ///< half of its half-power width times the record's length [-]
  double shift = 0.0;           ///< second half's frequency less the first's [Hz]
  double shift_sigma = 0.0;     ///< [Hz]
  double steadiness = 1.0;  ///< variance of its squared amplitude over that of random vibration [-]
  bool harmonic = false;    ///< driven at a steady frequency, or cannot be told from that
  std::vector<std::string> doubts;  ///< why it may be no mode, or not this one, in words
};

/// A motion that goes on all through the record, and became none of the modes.
struct AmbientSwing {
  double frequency = 0.0;  ///< about [Hz]
  double damping = 0.0;    ///< about: ratio [-]
  double share = 0.0;      ///< of the signals' variance, about [-]
};

/// Modes of an ambient record, and what the record is worth.
struct AmbientFit {
  DecayStatus status = DecayStatus::kTooLittle;
  std::string message;  ///< in words
  /// There are modes, which may be believed within their standard errors, but for their doubts.
  bool Usable() const { return status == DecayStatus::kGood; }

  std::vector<AmbientMode> modes;        ///< by rising frequency
  std::vector<AmbientSwing> left_out;    ///< by falling share
  std::vector<SteadyLine> lines;         ///< at which something drives the structure
  std::vector<StabilisationPole> poles;  ///< by part of the band, order, frequency
  std::vector<std::string> doubts;       ///< of the record as a whole, in words
  double step = 0.0;                     ///< of the instants [s]
  double duration = 0.0;                 ///< of what every signal has, gaps left out [s]
  double low = 0.0, high = 0.0;          ///< the band [Hz]
  double stationary = 1.0;      ///< chance of strengths that change as much from part to part [-]
  double strength_ratio = 1.0;  ///< of the strongest eighth's RMS over the weakest's [-]
};

/// Operational modal analysis: covariance-driven stochastic subspace identification, in parts of
/// the band of a factor of four each, poles that persist over the orders averaged, standard errors
/// by first-order perturbation of the sample covariances. Signals may differ in unit and rate; they
/// share their clock. Throws Error for options that make no sense; what the record does not give is
/// a status.
AmbientFit IdentifyAmbientModes(std::span<const DecaySignal> signals,
                                const AmbientOptions& options = {});

}  // namespace unfurl::correlate
