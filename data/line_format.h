#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace unfurl::data {

// How one recorded line of a linear CCD is laid out, element by element in order of read-out.
// Defaults: TCD1206. The reading u_px counts active pixels: centre of active pixel k at u = k.
struct LineFormat {
  std::string sensor = "TCD1206";
  int dummy = 13;  // elements before the dark ones
  int dark = 51;   // optically shielded
  int active = 2160;
  int dark_after = 9;
  int parity = 2;        // last elements, no light information
  int bits = 12;         // counts run from 0 to 2^bits - 1
  double pitch = 14e-6;  // [m]
  // Noise by the data sheet or from dark and flat records, for the weights of the estimators.
  double electrons_per_count = 0.0;  // [e-/count]; > 0
  double read_noise_counts = 0.0;    // standard deviation of one element in the dark [count]

  // Elements of one line, all kinds.
  std::size_t elements() const {
    return static_cast<std::size_t>(dummy + dark + active + dark_after + parity);
  }
  // Index of the first active element in the line.
  std::size_t first_active() const { return static_cast<std::size_t>(dummy + dark); }
  // The largest count [count].
  double full_scale() const { return static_cast<double>((1 << bits) - 1); }
};

// The lines of a record's cameras, side by side in their order: of one format, or each of its own.
struct LineFormats : LineFormat {     // the format of all of them
  std::vector<LineFormat> by_camera;  // where they differ; else empty

  /// The format of a camera.
  const LineFormat& Of(std::size_t camera) const {
    return by_camera.empty() ? *this : by_camera[camera];
  }
  // Elements, and active pixels, of the cameras before this one; of all, with their number.
  std::size_t ElementsBefore(std::size_t camera) const {
    if (by_camera.empty()) return camera * elements();
    std::size_t sum = 0;
    for (std::size_t c = 0; c < camera; ++c) sum += by_camera[c].elements();
    return sum;
  }
  std::size_t ActiveBefore(std::size_t camera) const {
    if (by_camera.empty()) return camera * static_cast<std::size_t>(active);
    std::size_t sum = 0;
    for (std::size_t c = 0; c < camera; ++c) sum += static_cast<std::size_t>(by_camera[c].active);
    return sum;
  }
};

}  // namespace unfurl::data
