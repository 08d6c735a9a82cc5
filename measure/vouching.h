#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "data/rig.h"
#include "measure/triangulate.h"

namespace unfurl::measure {

class HealthEvidence;

/// Where every place rests on three readings: these meet in a point whatever became of their
/// cameras, so what a trial says of itself cannot hold that. Or where more readings still leave one
/// camera free to shift by what moves places by more than error bars have.
struct Unvouched {
  bool any = false;               ///< too little vouches for places
  double shows_px = 0.0;          ///< from which shift on `camera` is found; 0: from none [px]
  int camera = -1;                ///< whose shift moves places the most
  double metres_per_px = 0.0;     ///< by which one pixel of it moves a place, median [m/px]
  double stated = 0.0;            ///< error of a place as its error bars have it, median [m]
  std::vector<double> by_camera;  ///< `metres_per_px` of each [m/px]
  /// Where distances that marks keep were looked at: by how much places may be off and those not
  /// show it; 0: they were not [m].
  double hidden = 0.0;
  /// With shifts that show in distances by camera [px]: what hides is no more than error bars have.
  void Narrow(std::span<const double> shows_px);
  /// Of places with more readings: with shifts that show in these by camera [px].
  void Weigh(std::span<const double> shows_px);
  /// With error bars wider by a factor.
  void Widen(double factor);
};

/// Of flashes of one mark. `any` is true where there are places at all.
Unvouched FindUnvouched(const HealthEvidence& evidence, const Triangulator& triangulator);

/// "nothing vouches for the cameras: ..."; empty where something does.
std::string Describe(const Unvouched& unvouched, std::span<const std::string> cameras);

/// Since the calibration each camera may have shifted along its row, by `sigma_px` as a standard
/// deviation, each by itself: what samples share then holds it.
void AllowForShifts(double sigma_px, data::Rig* rig);

}  // namespace unfurl::measure
