#pragma once

#include <span>
#include <string>

#include "correlate/modes/decay_fit.h"

namespace unfurl::correlate {

/// Damped sines imitate a vibration that changes as it fades (play, friction, a stiffness that
/// warms): several, close to each other, stand for one mode, and leave nothing but noise. The modes
/// of a structure that is linear are those of its later part, too: that is fitted by itself, from
/// where the strongest mode has half of its energy left. Each mode whose frequency or damping is
/// another one there beyond chance has the difference added to its standard errors (and to
/// `covariance`). Returns which and by how much, in words; empty: none, or too little is left.
/// `signals` are those of the fit, `chance` that of a false alarm.
std::string WidenByLaterPart(std::span<const DecaySignal> signals, const DecayOptions& options,
                             double chance, DecayFit* fit);

/// Pairs of modes nearer than the sum of their half-power half-widths, and of one shape within its
/// errors (or of one signal), in words: what they show may be one mode that changes as it fades.
/// Empty: none.
std::string OverlappingModes(const DecayFit& fit);

/// Frequencies [Hz] of modes that fade by less than a tenth over the signals, by two standard
/// errors, in words: what does not fade is driven, by a machine or the mains, as far as the record
/// tells. Empty: none.
std::string SteadyMotions(std::span<const DecaySignal> signals, const DecayFit& fit);

}  // namespace unfurl::correlate
