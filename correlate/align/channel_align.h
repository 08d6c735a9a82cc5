#pragma once

#include "correlate/align/align.h"

namespace unfurl::correlate {

/// A record without marks beside a model: the offset of its clock, by what its channels show, each
/// with the gain and bias that it is free to have. Offsets are tried over all of the overlap, as
/// finely as the signals change; the best are refined by least squares. As Align() else.
Alignment AlignChannels(const Observations& record, const SampledModel& model,
                        const AlignOptions& options);

/// Offsets at which the channels are like the model, the most alike first [s].
std::vector<double> ChannelOffsetsAlike(const Observations& record, const SampledModel& model,
                                        const AlignOptions& options);

}  // namespace unfurl::correlate
