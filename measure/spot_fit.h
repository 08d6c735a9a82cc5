#pragma once

#include <span>

#include "measure/spot.h"

namespace unfurl::measure {

struct PixelNoise {
  double electrons_per_count = 1.0;  // [e-/count]
  double dark_variance = 0.0;        // of a pixel without signal, all causes [count^2]
};

inline constexpr std::size_t kMostJoint = 4;  // spots that are fitted together

// Gaussians, integrated over each pixel, on one constant: Gauss-Newton on the weighted squares,
//   m_k = b + sum_i F_i (Phi((k + 1/2 - u_i)/s_i) - Phi((k - 1/2 - u_i)/s_i)),
// weights 1/V_k with V_k = dark_variance + max(m_k, 0) / electrons_per_count, renewed in every step
// (maximum likelihood), or all alike (least squares; its sigma is then that of V_k carried through
// the equal weights). `counts` holds n values above the background, of pixels first, first + 1, ..;
// those to leave out hold NaN. `spots`, one to kMostJoint of them, bring the guesses of centre and
// width and take the results. What fails has kSpotPoorFit.
void FitGaussians(std::span<const float> counts, int first, const PixelNoise& noise,
                  const SpotOptions& options, std::span<Spot> spots);

// One spot of them.
inline void FitGaussian(std::span<const float> counts, int first, const PixelNoise& noise,
                        const SpotOptions& options, Spot* spot) {
  FitGaussians(counts, first, noise, options, {spot, 1});
}

// The centroids: values above a tenth of the highest and four sigmas, or squared; width from the
// second moment. The background is taken as known.
void ReadCentroid(std::span<const float> counts, int first, const PixelNoise& noise,
                  const SpotOptions& options, Spot* spot);

}  // namespace unfurl::measure
