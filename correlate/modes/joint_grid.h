#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "correlate/modes/decay_fit.h"

namespace unfurl::correlate {

/// Several signals at the same instants, for methods that ask how they move together. l signals.
struct JointSignals {
  double step = 0.0;          ///< of the instants [s]
  std::vector<double> scale;  ///< l; each signal's RMS, by which it is divided [its unit]
  /// Instants one step apart at which every signal is known.
  struct Stretch {
    double start = 0.0;     ///< [s]
    Eigen::MatrixXd value;  ///< l x n, less each signal's straight line, over `scale` [-]
  };
  std::vector<Stretch> stretches;  ///< in order of time

  Eigen::Index samples() const;  ///< instants of all stretches
  double Duration() const;       ///< of all stretches, without the gaps [s]
};

/// The signals on the step of the slowest one, over what they have in common. A slower clock's
/// instants lie between its stamps by a local cubic; a signal of twice the rate or more passes a
/// low pass first. Gaps are not bridged. No stretches where nothing is in common; a signal that
/// never changes has a scale of 0 and stays 0.
JointSignals OnJointGrid(std::span<const DecaySignal> signals);

/// Every `factor`-th instant, after a low pass that lets 0.4 of the new rate through unharmed.
JointSignals Decimated(const JointSignals& joint, Eigen::Index factor);

}  // namespace unfurl::correlate
