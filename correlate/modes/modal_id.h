#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "correlate/modes/decay_fit.h"

namespace unfurl::correlate {

// Modes from a free decay, without a guess: the matrix pencil [Hua and Sarkar 1990] of all signals
// together at every order up to a limit, the poles that stay where they are from order to order
// gathered in clusters, and from their middles a maximum-likelihood fit (decay_fit.h).
struct ModalOptions {
  double low = 0.0;  // band to look in [Hz]; 0: one period of the record
  double high = std::numeric_limits<double>::infinity();  // and the rate's own limit [Hz]
  int max_order = 40;        // of the pencil; two per mode, and noise and trends take some
  double max_damping = 0.3;  // ratio above which a pole is no vibration [-]
  // A pole is stable when the next lower order has one within these.
  double frequency_tolerance = 0.01;  // relative [-]
  double damping_tolerance = 0.1;     // relative, or 0.002 absolute [-]
  double shape_tolerance = 0.05;      // 1 - MAC [-]
  // Part of the orders, from its first on, at which a cluster must be found to be a mode.
  double persistence = 0.5;  // [-]
  int most = 12;             // modes
  // Samples of each signal that are fitted, its first ones: a fit takes up to 1.3 kB for each. A
  // free decay is over by then, or Mode::information says what the rest holds.
  std::size_t most_samples = 100000;
  DecayOptions decay;
};

// A pole of the stabilisation diagram.
struct StabilisationPole {
  int order = 0;
  double frequency = 0.0;  // [Hz]
  double damping = 0.0;    // [-]
  bool stable_frequency = false, stable_damping = false, stable_shape = false;
  // In all three.
  bool stable() const { return stable_frequency && stable_damping && stable_shape; }
  int mode = -1;  // index into ModalFit::modes; -1: none
};

/// Modes, and the poles that they were chosen from.
struct ModalFit {
  DecayFit decay;                        // status, modes and what they are worth
  std::vector<StabilisationPole> poles;  // by order, then frequency
  double step = 0.0;                     // of the grid that the pencil saw [s]
  double low = 0.0, high = 0.0;          // the band [Hz]
  bool cut = false;                      // there are later samples than were fitted
  double until = 0.0;                    // latest stamp fitted [s]
};

/// Throws Error for options that make no sense; a decay without modes is a status.
ModalFit IdentifyModes(std::span<const DecaySignal> signals, const ModalOptions& options = {});

// Modes of two fits that belong together: nearest in frequency within `tolerance` of it (relative)
// and the shapes' MAC above 0.5 where their signals are the same; each used once.
struct ModePair {
  int a = -1, b = -1;  // indices; -1: no partner
  double mac = 0.0;    // [-]
};
std::vector<ModePair> PairModes(const std::vector<Mode>& a, const std::vector<Mode>& b,
                                double tolerance = 0.1);

}  // namespace unfurl::correlate
