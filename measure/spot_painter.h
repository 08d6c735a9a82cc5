#pragma once

#include <span>
#include <vector>

#include "measure/lens_camera.h"

namespace unfurl::measure {

// Lays a spot's light on the pixels: bundles onto a fine grid that keeps their flux and centroid
// exactly, then the blur (Gaussian) and the pixel's aperture (a box, full fill factor) as one
// kernel whose sum over the pixels is one.
class SpotPainter {
 public:
  explicit SpotPainter(double blur_px);

  // Adds `scale` times the spot's flux to `pixels` (active ones); what falls beside them is lost.
  void Add(const SpotLight& spot, double scale, std::span<double> pixels);

 private:
  static constexpr int kFine = 16;  // grid nodes per pixel
  int reach_ = 0;                   // of the kernel [px]
  std::vector<double> kernel_;      // [node phase][pixel offset + reach]
  std::vector<double> grid_;        // light by node [-]
};

}  // namespace unfurl::measure
