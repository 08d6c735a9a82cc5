#pragma once

#include <utility>

#include "correlate/align/align.h"

namespace unfurl::correlate {

// A record laid over a reference by frame, offset and drift.
struct Refined {
  RegistrationFit fit;
  Prediction reference;
  double drift = 0.0;  // already out of the stamps that the fit was made with
  bool converged = false;
};

// Frame and offset together, the reference asked anew at each offset; with a drift also the record
// is given its stamps anew.
Refined Refine(const Observations& record, const SampledModel& b, double offset, double drift,
               const AlignOptions& options);

// Sum of squares of the residuals and of the marks' motion about their own means [m^2].
std::pair<double, double> Squares(const Observations& a, const Refined& r);

// The same marks with a variance added to each coordinate of each sample [m^2].
Observations Loosened(Observations a, double variance);

// A reference that does not fit must not be followed at the price of the calibration's draw, and it
// is its misfit, not the marks' sigma, that limits the alignment: the variance that the residuals
// show is added to the marks' own until it changes no more. Gives that variance [m^2].
double RefineWithMisfit(const Observations& a, const SampledModel& b, const AlignOptions& options,
                        Refined* best);

// Samples (of channels: readings) with a counterpart that an alignment asks for. Fewer than 20 show
// no six frame numbers, an offset and a check; where frame and clock are known beforehand nothing
// is sought, and one shows that the reference has anything to compare with.
std::size_t FewestAligned(const Observations& record, const RegistrationOptions& options);

}  // namespace unfurl::correlate
