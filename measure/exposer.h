#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/random.h"
#include "data/lab.h"
#include "measure/lens_camera.h"
#include "measure/sensor.h"
#include "measure/spot_painter.h"
#include "measure/virtual_rig.h"

namespace unfurl::measure {

// A mean of 1 + depth sin(2 pi frequency t + phase) over [from, until] [-].
double MeanFlicker(double depth, double frequency, double phase, double from, double until);

// Light, line by line and camera by camera, and the counts that come of it. What the lab does not
// call for is not computed. One for each thread.
class Exposer {
 public:
  Exposer(const data::Lab& lab, const VirtualRig& rig);

  // An LED during one flash: its light is shared among the instants, at which it stood at these
  // places in W; `axis` as in LabLed, in W.
  struct Led {
    std::span<const Eigen::Vector3d> instants;
    Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  // [-]
  };
  struct Line {
    std::span<const Led> leds;  // lit together; none in a dark line
    double electrons = 0.0;     // per steradian, of each [1/sr]
    double t = 0.0;             // middle of the line by the recorder's clock [s]
    // Of the mains over the line: those of `lab` at true time `t`, unless the phase is drawn.
    double mains_phase = 0.0;  // [rad]
  };

  // The charge of camera c's pixels by this line's light. With residual charge the lines of a
  // camera must come in order; `Forget` starts anew.
  void Collect(std::size_t c, const Line& line);
  // And read out.
  void Read(std::size_t c, double dark_level, Rng rng, std::span<std::uint16_t> counts);
  void Forget();

 private:
  void AddLed(std::size_t c, const Led& led, double electrons, double t);
  void AddAmbient(std::size_t c, const Line& line);

  const data::Lab& lab_;
  const VirtualRig& rig_;
  std::vector<SpotPainter> painters_;  // by camera
  double led_exponent_ = 0.0;          // m of cos^m; 0: alike in all directions [-]
  std::vector<Disc> mirrors_;
  std::vector<Disc> occluders_;               // those that stand there now
  std::vector<double> pixels_;                // electrons of the current camera [-]
  std::vector<std::vector<double>> ambient_;  // by camera: over a line, unmodulated [e-], or empty
  std::vector<std::vector<double>> lamps_;    // camera x lamp: its light in a line [e-]
  std::vector<std::vector<double>> remains_;  // by camera: charge that is left [e-]; empty: none
};

// Lines that residual charge is followed back: what is older is below a millionth.
int ResidualMemory(const data::LabSensor& sensor);

}  // namespace unfurl::measure
