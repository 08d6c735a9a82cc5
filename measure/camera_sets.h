#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "measure/health_flash.h"

namespace unfurl::measure {

// What happened at one moment: a function of time, and the cameras that it happened to.
struct CameraEvent {
  FaultKind kind = FaultKind::kMoved;
  double from = 0.0, earliest = 0.0, latest = 0.0;  // [s]
  double at = 0.0, span = 1.0;                      // of a drift [s]
  std::uint32_t cameras = 0;                        // bit c: camera c
  int shapes() const { return kind == FaultKind::kDrifting ? 2 : 1; }
  double Shape(int k, double t) const;
  bool Holds(const Fault& fault) const;  // whether the fault may be of this event
};

// What sets of cameras explain of a trial, one set for each event, with the size of every camera's
// fault free, the marks anywhere and the calibration's errors as likely as it says. A flash that
// they do not explain costs what a wrong reading costs.
class CameraSets {
 public:
  CameraSets(const HealthEvidence& evidence, const Triangulator& triangulator,
             const HealthOptions& options, std::size_t marks, std::vector<CameraEvent> events);

  struct Unknown {
    std::size_t event = 0;
    int camera = 0, shape = 0;
  };
  struct Fit {
    std::vector<std::uint32_t> sets;  // cameras, by event
    std::vector<Unknown> unknowns;
    Eigen::VectorXd value;        // [px]
    Eigen::MatrixXd covariance;   // [px^2]
    double loss = 0.0;            // of all flashes [-]
    double wide = 1.0;            // Overdispersion
    std::size_t unexplained = 0;  // flashes
    struct Flash {
      double loss = 0.0;     // at most what one costs [-]
      double numbers = 1.0;  // that its place does not explain
    };
    std::vector<Flash> flashes;
  };
  Fit Solve(const std::vector<std::uint32_t>& sets) const;
  // -2 ln of how probable a fit is, with variances wider by a factor: its loss, its numbers, and
  // the cameras that went at once.
  double Price(const Fit& fit, double wide) const;
  // Whether what contradicts itself while an event lasts, until the next one, is explained by it,
  // and not by a part only: `without` is the same without the event.
  bool Explains(const Fit& fit, const Fit& without, std::size_t event) const;
  // As faults, each certain.
  std::vector<Fault> FaultsOf(const Fit& fit) const;

  const std::vector<CameraEvent>& events() const { return events_; }
  std::size_t flashes() const { return lines_.size(); }

 private:
  double Taken(const Fit& fit, int camera, double t) const;
  std::vector<FlashTerms> Terms(const Fit& fit) const;
  void Reduce();
  double Cap(const FlashTerms& flash) const;
  void Refine(const std::vector<FlashTerms>& terms, bool far, Fit* fit) const;

  const HealthEvidence& evidence_;
  const Triangulator& triangulator_;
  const HealthOptions& options_;
  std::size_t marks_;
  FlashErrors errors_;
  std::vector<CameraEvent> events_;
  std::vector<std::size_t> lines_;  // of the evidence
  Eigen::MatrixXd directions_;      // of the calibration's errors
  double most_ = 0.0;               // that a flash costs [-]
};

}  // namespace unfurl::measure
