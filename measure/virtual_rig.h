#pragma once

#include <vector>

#include "data/lab.h"
#include "measure/lens_camera.h"
#include "measure/sensor.h"

namespace unfurl::measure {

// What truly stands in the laboratory: the lab's layout with the mounting errors drawn from its
// seed. Known to `expose` alone.
struct VirtualRig {
  std::vector<LensCamera> cameras;      // c
  std::vector<double> drift_phase;      // c, of the dark level's drift [rad]
  std::vector<SensorPattern> patterns;  // c
  double mains_phase = 0.0;             // of all flicker, at true time 0 [rad]
  Pose X_WM = Pose::Identity();         // the model's plane
  double lead = 0.0;                    // from start of recording to release [s]
  // Electrons per steradian that an LED yields in one flash, and in one exposure of the survey.
  double flash_electrons = 0.0;   // [1/sr]
  double survey_electrons = 0.0;  // [1/sr]
};

VirtualRig MakeVirtualRig(const data::Lab& lab);

// Where a camera is meant to be.
Pose NominalPose(const data::LabCamera& camera);

}  // namespace unfurl::measure
