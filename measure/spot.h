#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "data/line_format.h"
#include "measure/background.h"
#include "measure/spot_peaks.h"

namespace unfurl::measure {

// Quality of a reading; several may hold.
enum SpotFlag : std::uint8_t {
  kSpotSaturated = 1,  // some pixels were full and left out of the fit
  kSpotEdge = 2,       // the spot runs off the active pixels
  kSpotOverlap = 4,    // a second spot touches it
  kSpotDim = 8,        // nothing above the noise
  kSpotSecond = 16,    // another spot elsewhere on the line
  kSpotPoorFit = 32,   // the fit did not converge, or to something that is no spot, or to one so
                       // wide that what was taken for the room's light is part of it
  kSpotShape = 64,     // by chi-square not one Gaussian: two lights in one, part of one hidden, or
                       // bright and out of focus
};

/// Light on a line.
struct Spot {
  double u_px = 0.0;      // centre [px]; only meaningful when Usable or Resolved
  double s_px = 0.0;      // its standard deviation [px]
  double width_px = 0.0;  // sigma of the Gaussian [px]
  double flux = 0.0;      // [count]
  double misfit = 0.0;    // chi-square per degree of freedom [-]; 0 where there was no fit
  std::uint8_t flags = kSpotDim;
};

// What may enter a triangulation where one LED is lit. Saturated spots may: their tails still tell,
// with the larger sigma that the fit states for them. So may the brighter of two spots that stand
// apart; the residual test is there for the case that it was the reflection.
inline bool Usable(const Spot& spot) {
  return (spot.flags & (kSpotEdge | kSpotOverlap | kSpotDim | kSpotPoorFit)) == 0;
}

// What is a reading of some light, one of several perhaps: touching neighbours were fitted together
// with it, and its sigma has grown by what they take away. Which light it is, is not said.
inline bool Resolved(const Spot& spot) {
  return (spot.flags & (kSpotEdge | kSpotDim | kSpotPoorFit)) == 0;
}

// How the centre is found; docs/physics-optics.md charts what each misses and costs.
enum class SpotEstimator : std::uint8_t {
  kThresholdedCentroid,  // of what rises above a tenth of the peak; at the speed of memory
  kSquaredCentroid,      // weights are the counts squared
  kLeastSquares,         // Gaussian, all pixels alike
  kMaximumLikelihood,    // Gaussian, each pixel by its variance at the fitted value
};

/// How spots are found and measured.
struct SpotOptions {
  SpotEstimator estimator = SpotEstimator::kMaximumLikelihood;
  double threshold = 6.0;  // detection, in sigmas of the dark noise [-]
  // A spot whose chi-square per degree of freedom exceeds 1 by more than this many of its own
  // standard deviations is not the shape that was fitted: its sigma grows by sqrt(chi-square /
  // dof) [-].
  double misfit_sigmas = 3.0;
};

// Finds the spots of a line. The fits lay a Gaussian, integrated over each pixel, on a constant:
// centre, width, flux and constant are all free; spots whose light meets are fitted together. The
// variance of a pixel is that of the noise model (shot noise, read noise, quantisation, the
// background's own error); s_px follows from the Fisher matrix.
class SpotFinder {
 public:
  explicit SpotFinder(const data::LineFormat& format, const SpotOptions& options = {});

  const data::LineFormat& format() const { return format_; }  // of the lines

  // What a spot of that width must shine to stand out of a line as the last one was [count].
  double LeastFlux(double width_px) const;

  // Flat field: each active pixel's response relative to the sensor's mean [-]; empty: all alike.
  void SetResponse(std::span<const float> response);

  // The brightest spot. `line` holds all elements. Not safe for several threads: one finder each.
  Spot Find(std::span<const std::uint16_t> line, const Background& background);

  // Every spot of the line that stands out of the noise, by growing u: how many, at most
  // spots.size(); where there are more, the brightest. kSpotSecond marks that there are several.
  // Two lights nearer to each other than about 4 of their widths make one hill and are one spot
  // here; where they are bright enough to tell, it has kSpotShape.
  std::size_t FindAll(std::span<const std::uint16_t> line, const Background& background,
                      std::span<Spot> spots);

 private:
  // Fills signal_, sums_ and peaks_; false when there is nothing to see.
  bool Detect(std::span<const std::uint16_t> line, const Background& background);
  void SubtractBaseline(float sigma);
  // The end of the group of peaks, at most kMostJoint, that is fitted together with `first`.
  std::size_t GroupEnd(std::size_t first) const;
  // Reads the peaks [first, last) into as many spots.
  void Read(std::span<const std::uint16_t> line, std::size_t first, std::size_t last,
            std::span<Spot> spots);
  bool Fits() const;  // else a centroid
  // Fills window_ from pixel `from` to `to`, without those that saturation spoils, and flags the
  // spots of the peaks from `first` on that have such pixels.
  void FillWindow(std::span<const std::uint16_t> line, int from, int to, std::size_t first,
                  std::span<Spot> spots);
  Spot FindFast(std::span<const std::uint16_t> line, const Background& background);

  data::LineFormat format_;
  SpotOptions options_;
  std::vector<float> inverse_response_;  // of the active pixels; empty: 1 [-]
  std::vector<float> signal_;            // active pixels above the background [count]
  std::vector<float> sums_;              // of five of them, or of fifteen [count]
  std::vector<float> scratch_;           // sums_ in the making [count]
  std::vector<float> window_;            // signal_ by response; NaN: left out [count]
  std::vector<SpotPeak> peaks_;
  double dark_variance_ = 0.0;  // of one pixel of this line [count^2]
  int full_;                    // a pixel that is full may read as little as this [count]
  double widest_ = 0.0;         // spots that the baseline leaves whole; 0: there was none [px]
};

// The flat field of a record, camera by camera (empty: none), to a finder for each camera.
void SetResponses(std::span<const float> response, std::span<SpotFinder> finders);

}  // namespace unfurl::measure
