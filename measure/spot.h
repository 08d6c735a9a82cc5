#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "data/line_format.h"
#include "measure/background.h"

namespace unfurl::measure {

// Quality of a reading; several may hold.
enum SpotFlag : std::uint8_t {
  kSpotSaturated = 1,  // some pixels were full and left out of the fit
  kSpotEdge = 2,       // the spot runs off the active pixels
  kSpotOverlap = 4,    // a second spot touches it
  kSpotDim = 8,        // nothing above the noise
  kSpotSecond = 16,    // another spot elsewhere on the line; this is the brighter one
  kSpotPoorFit = 32,   // the fit did not converge, or to something that is no spot
};

struct Spot {
  double u_px = 0.0;      // centre [px]; only meaningful when Usable
  double s_px = 0.0;      // its standard deviation [px]
  double width_px = 0.0;  // sigma of the Gaussian [px]
  double flux = 0.0;      // [count]
  double misfit = 0.0;    // chi-square per degree of freedom [-]
  std::uint8_t flags = kSpotDim;
};

// What may enter a triangulation. Saturated spots may: their tails still tell, with the larger
// sigma that the fit states for them. So may the brighter of two spots that stand apart; the
// residual test is there for the case that it was the reflection.
inline bool Usable(const Spot& spot) {
  return (spot.flags & (kSpotEdge | kSpotOverlap | kSpotDim | kSpotPoorFit)) == 0;
}

struct SpotOptions {
  double threshold = 6.0;  // detection, in sigmas of a sum of five pixels [-]
  // A spot whose chi-square per degree of freedom exceeds 1 by more than this many of its own
  // standard deviations is not the shape that was fitted: its sigma grows by sqrt(chi-square /
  // dof).
  double misfit_sigmas = 3.0;
};

// Finds the spot of a line and fits a Gaussian, integrated over each pixel, on a constant: centre,
// width, flux and constant are all free. Weighted least squares with each pixel's variance taken
// from the noise model at the fitted value (shot noise, read noise, quantisation, the background's
// own error) and renewed in every step; s_px follows from the Fisher matrix.
class SpotFinder {
 public:
  explicit SpotFinder(const data::LineFormat& format, const SpotOptions& options = {});

  // `line` holds all elements. Not safe for several threads: one finder each.
  Spot Find(std::span<const std::uint16_t> line, const Background& background);

 private:
  data::LineFormat format_;
  SpotOptions options_;
  std::vector<float> signal_;  // active pixels above the background [count]
  std::vector<float> sums_;    // of five of them [count]
};

// The fit alone: `counts` n values above the background, of pixels first, first + 1, ...; those
// that are saturated hold NaN. `spot` brings the guess of centre and width and takes the result.
struct PixelNoise {
  double electrons_per_count = 1.0;  // [e-/count]
  double dark_variance = 0.0;        // of a pixel without signal, all causes [count^2]
};
void FitGaussian(std::span<const float> counts, int first, const PixelNoise& noise,
                 const SpotOptions& options, Spot* spot);

}  // namespace unfurl::measure
