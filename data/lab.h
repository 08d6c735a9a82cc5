#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "data/lens.h"
#include "data/line_format.h"

namespace unfurl::data {

// The physical truth of a virtual experiment, as a person wrote it in TOML. Keys of the file equal
// the fields' names; docs/lab.md lists them with units and marks what is assumed. Frames: W world,
// M the model's plane (z = 0 in M), C camera (data/rig.h).

// The cylinder lens behind the slit, one for all cameras.
struct LabLens {
  // "glass": rays are traced through what follows. Or a lens model (data/lens.h) that makes the
  // image by its formula, with what stands after the glass.
  std::string model = "glass";
  double index = 0.0;      // of the glass at the LEDs' wavelength [-]
  double radius = 0.0;     // of each curved face [m]
  double thickness = 0.0;  // on the axis [m]
  std::string curved;      // faces that are curved: "back" (towards the sensor), "front", "both"
  double width = 0.0;      // across the cylinder's axis [m]
  double length = 0.0;     // along it [m]
  double focus_distance = 0.0;  // slit to the point that is imaged sharpest [m]
  // Of a model:
  double focal_length = 0.0;  // f over the pixels' pitch [m]
  double centres = 0.0;       // e, distance between the two centres [m]
  double spot = 0.0;          // width over which a point's light is spread before blur [m]
  std::array<double, kLensTerms> terms{};  // in the model's order, over f [-]

  /// Whether rays are followed through the lens' glass.
  bool traced() const { return model == "glass"; }
};

// The slit in front of the lens, across the cylinder's axis.
struct LabSlit {
  double width = 0.0;     // [m]
  double length = 0.0;    // along the cylinder's axis [m]
  double distance = 0.0;  // slit to the lens' first vertex [m]
};

// Each effect of the sensor is off at 0 (or false); values no datasheet gives are assumed.
struct LabSensor {
  LineFormat format;             // layout, bits; its noise entries follow from what is below
  double full_well = 0.0;        // electrons at full scale [e-]
  bool shot_noise = true;        // of signal and dark electrons
  double read_noise = 0.0;       // [e-]
  double dark_level = 0.0;       // electronic offset under every element [e-]
  double dark_drift = 0.0;       // amplitude of a slow sine of that offset [e-]
  double dark_drift_period = 1;  // [s]
  double blur = 0.0;             // sigma of diffraction and charge diffusion on the sensor [m]
  // Odd and even elements come through two registers.
  double odd_gain = 0.0;    // gain of odd active pixels over that of even ones, less one [-]
  double odd_offset = 0.0;  // offset of odd elements above that of even ones [e-]
  // Fixed patterns, drawn once per camera; each a standard deviation.
  double nonuniformity = 0.0;       // of the pixels' response to light, relative [-]
  double dark_nonuniformity = 0.0;  // of the pixels' offset [e-]
  double blooming = 0.0;  // share of what a full pixel cannot hold that its neighbours get [-]
  double residual = 0.0;  // share of a line's charge that is read with the next line [-]

  // True where readings need a flat field: gains or offsets differ from pixel to pixel.
  bool has_pattern() const {
    return odd_gain != 0.0 || odd_offset != 0.0 || nonuniformity > 0.0 || dark_nonuniformity > 0.0;
  }
};

// A record of evenly lit lines from which the readings' flat field is made; 0 lines: none.
struct LabFlatField {
  int lines = 0;       // evenly lit, and as many dark
  double level = 0.0;  // of the light over full scale [-]
};

// Light that falls on all pixels for the whole of a line, at the mains' pace.
struct LabAmbient {
  double level = 0.0;        // in the middle of the sensor [e-/s]; 0: none
  double slope = 0.0;        // relative change from the middle to the last pixel [-]
  double flicker = 0.0;      // amplitude over mean [-]
  double frequency = 100.0;  // [Hz]
};

// [lamp.NAME]: a small steady or flickering light in view.
struct LabLamp {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // in W [m]
  double brightness = 0.0;   // light in a line over that of an LED's flash on its axis [-]
  double flicker = 0.0;      // amplitude over mean [-]
  double frequency = 100.0;  // [Hz]
};

// A flat disc in W.
struct LabDisc {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();   // [m]
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // of unit length, in W [-]
  double radius = 0.0;                                // [m]
};

// [reflection.NAME]: a mirror; an LED's image in it is a second spot.
struct LabReflection {
  LabDisc disc;
  double reflectance = 0.0;  // [-]
};

// [occluder.NAME]: what stands in the way, for a while.
struct LabOccluder {
  LabDisc disc;
  double from = 0.0, until = 0.0;  // by the recorder's clock [s]
};

// The light-emitting diodes of model and survey.
struct LabLed {
  double peak = 0.0;          // of the brightest pixel over full scale, on the optical axis at the
                              // focus distance, with `flash` [-]
  double flash = 0.0;         // length of a strobe [s]
  double survey_flash = 0.0;  // exposure of one line of the survey, same LED [s]
  // Intensity falls with the angle from the LED's axis as cos^m, to half at `half_angle` [rad]; 0:
  // alike in all directions. The axis stands in M for the model's LEDs, in W for the survey's.
  double half_angle = 0.0;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  // of unit length [-]
};

// Which mark is lit in which line.
struct LabStrobe {
  double line_rate = 0.0;          // [1/s]
  std::vector<std::string> slots;  // what is lit in each line, in turn: a mark's name or "dark"
  std::array<double, 2> lead{};    // recording starts this long before release: drawn from here [s]
  double clock_drift = 0.0;        // of the recorder against true time, relative [-]
};

// Each a standard deviation, drawn once per camera from the seed; the user never learns the draw.
struct LabMounting {
  double position = 0.0;       // of the slit, per axis [m]
  double rotation = 0.0;       // of the camera, per axis [rad]
  double sensor_shift = 0.0;   // of the sensor along its row [m]
  double sensor_roll = 0.0;    // of the row about the optical axis, against the cylinder [rad]
  double sensor_tilt = 0.0;    // of the sensor about the cylinder's axis [rad]
  double lens_decentre = 0.0;  // of the lens across the slit [m]
};

// [camera.NAME], where it is meant to be.
struct LabCamera {
  std::string name;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // of the slit in W [m]
  Eigen::Vector3d look_at = Eigen::Vector3d::Zero();   // in W [m]
  // Of the lens axis about the optical axis, from W's x axis as the camera sees it [rad].
  double roll = 0.0;
  // [camera.NAME.lens] and [camera.NAME.sensor]: where it differs from the others.
  std::optional<LabLens> lens;
  std::optional<LabSensor> sensor;
};

// Pose of the model's plane M in W.
struct LabModelPlane {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // of M's origin in W [m]
  double yaw = 0.0;                                    // about W's z axis [rad]
  std::array<double, 2> tilt{};                        // then about M's x and y axes [rad]
};

// The total station.
struct LabSurvey {
  double sigma = 0.0;  // of the total station, per axis [m]
};

// The laboratory: cameras as they are meant to stand, optics, sensor, light, disturbances.
struct Lab {
  std::string path;
  std::uint64_t seed = 0;
  Eigen::Vector3d volume_low = Eigen::Vector3d::Zero();   // the volume, in W [m]
  Eigen::Vector3d volume_high = Eigen::Vector3d::Zero();  // [m]
  LabLens lens;
  LabSlit slit;
  LabSensor sensor;
  LabLed led;
  LabStrobe strobe;
  LabMounting mounting;
  LabModelPlane model;
  LabSurvey survey;
  LabFlatField flat_field;
  LabAmbient ambient;
  std::vector<LabLamp> lamps;
  std::vector<LabReflection> reflections;
  std::vector<LabOccluder> occluders;
  std::vector<LabCamera> cameras;

  /// Of a camera: its own, or the one of all.
  const LabLens& LensOf(std::size_t camera) const {
    return cameras[camera].lens ? *cameras[camera].lens : lens;
  }
  /// Of a camera: its own, or the one of all.
  const LabSensor& SensorOf(std::size_t camera) const {
    return cameras[camera].sensor ? *cameras[camera].sensor : sensor;
  }
};

// Throws Error with file:line:key for whatever is missing, unknown or impossible.
Lab ReadLab(const std::string& path, const std::vector<std::string>& overrides = {});

inline constexpr char kDarkSlot[] = "dark";

}  // namespace unfurl::data
