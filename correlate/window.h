#pragma once

#include <cstddef>
#include <vector>

namespace unfurl::correlate {

// Sums of cosines, w_i = sum_k (-1)^k a_k cos(2 pi k i / n), in the periodic form (i = 0 .. n - 1),
// whose transform is zero but for a few bins [Harris 1978].
enum class SpectralWindow {
  kRectangular,
  kHann,            // for looking: narrow, leakage falls fast
  kHamming,         // nearest side lobe 43 dB down
  kBlackman,        // side lobes 58 dB down
  kBlackmanHarris,  // four terms, side lobes 92 dB down: weak peaks beside strong ones
  kFlatTop,         // five terms: amplitudes right to 0.01 dB wherever between the bins
};
const char* Name(SpectralWindow window);

std::vector<double> WindowValues(SpectralWindow window, std::size_t n);

// Mean of w: what a sine's peak is divided by. a_0.
double CoherentGain(SpectralWindow window);
// Width in bins of the ideal filter that passes as much white noise: n sum w^2 / (sum w)^2 =
// (a_0^2 + sum a_k^2 / 2) / a_0^2.
double NoiseBandwidth(SpectralWindow window);
// Size of the transform `bins` away from a sine, over its size on the bin (n large).
double WindowResponse(SpectralWindow window, double bins);
// How far from the higher bin a sine lies, in [0, 0.5] bins towards its higher neighbour, from the
// ratio of the two.
double BinOffset(SpectralWindow window, double ratio);

}  // namespace unfurl::correlate
