#pragma once

#include <vector>

#include "correlate/modes/joint_grid.h"

namespace unfurl::correlate {

/// A frequency at which signals go on for the whole record without changing: a machine's, the
/// mains'; no structure vibrates like this by itself.
struct SteadyLine {
  double frequency = 0.0;   ///< [Hz]
  double chance = 0.0;      ///< of one as high anywhere, were there none [-]
  Eigen::Index signal = 0;  ///< that shows it best
  double amplitude = 0.0;   ///< there [unit of the signal]
};

/// Lines in the longest stretch: ordinates of a Hann-windowed periodogram that stand out of the
/// sixteen about them by more than those scatter, F(2, 32) where the spectrum is flat over them.
/// `chance`: that of noise, over all ordinates and signals, below which one is believed.
std::vector<SteadyLine> FindSteadyLines(const JointSignals& joint, double chance);

/// How a narrow-band vibration's squared amplitude varies, over what it would were it random
/// (1: random; 0: as steady as a machine's), with its standard error for a random one.
struct Steadiness {
  double value = 1.0;  ///< [-]
  double sigma = 0.0;  ///< [-]; 0: too short to say
};
/// Of what all signals show of `shape` (real weights, one per signal) at a frequency [Hz], within
/// `width` [Hz] of it.
Steadiness SteadinessOf(const JointSignals& joint, const Eigen::VectorXd& shape, double frequency,
                        double width);

}  // namespace unfurl::correlate
