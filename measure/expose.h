#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

#include "data/lab.h"
#include "data/run.h"
#include "data/survey.h"
#include "data/tracks.h"
#include "data/trial.h"

namespace unfurl::measure {

// The virtual experiment: what the cameras of a lab would have recorded of a run's marks, or of the
// LED that a surveyor carries from point to point.

// A mark's way in the model's plane: cubic Hermite between the run's samples, at rest where it
// starts before them.
class MarkPath {
 public:
  // Throws Error when the run lacks the mark's columns.
  MarkPath(const data::Run& run, const std::string& mark);
  Eigen::Vector3d At(double t) const;  // in M [m]

 private:
  std::span<const double> t_, x_, y_, vx_, vy_;
};

/// How the work is shared and followed.
struct ExposeOptions {
  std::size_t workers = 0;               // 0: all cores; the result does not depend on it
  std::function<void(double)> progress;  // called with what is done, 0 to 1
};

// What a trial of this lab says before its first line.
data::TrialHeader HeaderOf(const data::Lab& lab);

// Lines from the start of recording until the run ends. `truth`, when not null, gets where each
// flash truly was (frame "rig", stamps as in the trial, no covariance).
void ExposeTrial(const data::Lab& lab, const data::Run& run, data::TrialWriter& trial,
                 const ExposeOptions& options, data::Tracks* truth);

// A survey of the given points (p: where the LED truly stands; cov: the station's, or zero to take
// the lab's sigma). Returns what the station states, with a lit and a dark line per camera.
data::Survey ExposeSurvey(const data::Lab& lab, const data::Survey& points,
                          const ExposeOptions& options);

}  // namespace unfurl::measure
