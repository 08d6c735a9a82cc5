#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "base/random.h"
#include "data/rig.h"
#include "measure/health.h"
#include "measure/virtual_rig.h"

namespace unfurl::measure {

// What is done to the light of a record.
struct Shade {
  LightKind kind = LightKind::kLed;
  int camera = -1, mark = -1;  // of which; -1: all
  double share = 0.0;          // change of light at the end, relative [-]
  double focus = 0.0;          // the sensor moves so far from the lens [m]
  double from = 0.0;           // [s]
  double over = 0.0;           // until it has its size; 0: at once [s]
};

// How marks move.
enum class Course {
  kSwing,   // to and fro, each in its own way
  kUnfold,  // from a stack to their places, once, with a tremor at the end
};

// Cameras on a ring, as HealthTrial has them, and marks whose light and width are traced through
// glass; LEDs that shine upwards, as cos^2 of the angle. Made once, drawn from many times.
class LightTrial {
 public:
  // `lines` at 1 kHz, one mark in each in turn and then none.
  LightTrial(std::size_t cameras, int marks, int lines, Course course);

  const data::Rig& rig() const { return rig_; }
  // Evidence with noise: of readings 0.03 px, of light 2%, of widths 3%; one spot in 50 is a
  // reflection of any light, width and place.
  HealthEvidence Draw(const std::vector<Shade>& shades, Rng* rng) const;
  // By how much a camera's spots are wider around a time, all in all, when its sensor is so far
  // from where it is, relative [-].
  double Blur(std::size_t camera, double focus, double at) const;

 private:
  struct Line {
    double t = 0.0;
    int mark = -1;
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    std::vector<double> u, flux, width;  // by camera; NaN: not seen
  };
  double WidthAt(const Line& line, std::size_t camera, double focus) const;
  std::vector<LensCamera> cameras_;
  data::Rig rig_;
  std::vector<Line> lines_;
};

}  // namespace unfurl::measure
