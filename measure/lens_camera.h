#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/pose.h"
#include "data/rig.h"
#include "measure/ray.h"

namespace unfurl::measure {

// A linear CCD behind a cylinder lens as it truly is: light from a point passes the slit, two
// refracting faces and falls on the sensor's row. Frame C as in data/rig.h: origin at the slit's
// centre, Z towards the scene, Y along the cylinder's axis; light travels towards -Z.

struct Glass {
  double index = 1.0;            // [-]
  std::array<Surface, 2> faces;  // in the order in which light meets them
  double half_width = 0.0;       // of the faces, across the axis and along it [m]
  double half_length = 0.0;      // [m]
};

// The row of pixels. `row` points to growing u; the row is `pitch` high.
struct SensorRow {
  Eigen::Vector3d centre;  // of the middle of the active row in C [m]
  Eigen::Vector3d row;     // unit [-]
  Eigen::Vector3d column;  // unit, in the sensor's plane, across the row [-]
  double pitch = 0.0;      // [m]
  int pixels = 0;          // active ones
  double blur = 0.0;       // sigma of diffraction and charge diffusion [m]
};

struct LensCamera {
  std::string name;
  Pose X_WC = Pose::Identity();
  double slit_half_width = 0.0;   // [m]
  double slit_half_length = 0.0;  // [m]
  Glass glass;
  // Instead of the glass: its pose, image and offset by a lens model's formula, and the width over
  // which a point's light is spread on the row [m]. X_WC and the sensor's place then do not count.
  std::optional<data::RigCamera> model;
  double spot = 0.0;  // [m]
  SensorRow sensor;
};

// Where a ray from the scene through the slit's point (x, y, 0) meets the sensor's plane.
struct Landing {
  double u = 0.0;             // along the row [px]
  double across = 0.0;        // across it [m]
  double transmission = 0.0;  // of both faces [-]
};
// False when the ray misses a face or is reflected totally. `p_C` is the source, Z > 0.
bool TraceThroughSlit(const LensCamera& camera, const Eigen::Vector3d& p_C, double x, double y,
                      Landing* landing);

// The light that a point source of unit intensity [1/sr] sends to the row, as it arrives before it
// is blurred: `kSlitSamples` bundles, each spread evenly from `low` to `high` along the row.
inline constexpr int kSlitSamples = 24;
struct Bundle {
  double low = 0.0, high = 0.0;  // [px]
  double flux = 0.0;             // per unit intensity [sr]
};
struct SpotLight {
  std::array<Bundle, kSlitSamples> bundles;
  int count = 0;           // bundles that arrive
  double flux = 0.0;       // their sum [sr]
  double centre_px = 0.0;  // the irradiance's centroid: the truth of a reading [px]
  double sigma_px = 0.0;   // and its standard deviation about it [px]
};
// A flat disc in W: it stops what crosses it, or mirrors it.
struct Disc {
  Eigen::Vector3d centre;  // [m]
  Eigen::Vector3d normal;  // unit [-]
  double radius = 0.0;     // [m]

  // Where the straight way from a to b crosses it; false when it does not.
  bool Crosses(const Eigen::Vector3d& a, const Eigen::Vector3d& b, Eigen::Vector3d* where) const;
  Eigen::Vector3d Mirrored(const Eigen::Vector3d& p) const;
};

// What light meets between its source and the slit. The slit is tried strip by strip: what hides
// part of it moves the light's centre.
struct LightPath {
  std::span<const Disc> occluders;
  const Disc* mirror = nullptr;  // light comes by way of this one; null: straight
};

// False when nothing of the light arrives at the row's plane within the slit, lens and sensor.
// `path`, when null, is straight and free.
bool TraceSpot(const LensCamera& camera, const Eigen::Vector3d& p_W, SpotLight* spot,
               const LightPath* path = nullptr);

// The distance from the slit at which a sensor across the axis sees a point on the axis, `distance`
// in front of the slit, sharpest: least variance of where the slit's rays land [m].
double FocusedSensorDistance(const LensCamera& camera, double distance);

}  // namespace unfurl::measure
