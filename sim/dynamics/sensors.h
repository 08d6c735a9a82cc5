#pragma once

#include <vector>

#include "sim/dynamics/centre_line.h"
#include "sim/dynamics/dynamics.h"
#include "sim/model/model.h"

namespace unfurl::sim {

/// What the scene's instruments read at a state: specific force, rate of turning, curvature and
/// strain at a place (docs/scene.md, "Sensors"). Without any of them it costs nothing.
class Sensors {
 public:
  explicit Sensors(const Model& model);

  /// Whether any of them needs accelerations, that is a right side before Read.
  bool NeedsRates() const { return needs_rates_; }
  /// Reads all at `state` [unit of each]; `rates` is the right side there. The dynamics is left at
  /// another state: bring it up to date again.
  void Read(double t, double* state, const double* rates, Dynamics* dynamics);
  /// Of the last Read, by sensor [unit of each].
  const std::vector<double>& readings() const { return readings_; }

 private:
  // Velocity of a sensor's place along its axes at that moment, the axes held.
  struct Turn {
    double angle, rate;  // of the place [rad], [rad/s]
  };
  Turn TurnOf(const Model::Sensor& sensor, const double* state) const;
  double StepAt(const double* state) const;  // of differences along the motion there [s]

  const Model& model_;
  bool needs_rates_ = false;
  std::vector<CentreLine> lines_;  // by beam
  std::vector<double> readings_, moved_;
};

}  // namespace unfurl::sim
