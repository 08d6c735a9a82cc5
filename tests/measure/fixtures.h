#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "data/lab.h"
#include "data/rig.h"
#include "data/run.h"
#include "measure/camera_model.h"
#include "measure/lens_camera.h"
#include "measure/virtual_rig.h"

namespace unfurl::measure {

data::Lab ShippedLab(const std::vector<std::string>& overrides = {});

// The two-centre model laid through what a camera truly sees of `points` (the irradiance's
// centroids), by Gauss-Newton with a least-norm step, started from where the camera truly stands.
// `rms_px`, when not null, gets what the model cannot follow. Not a calibration: no noise, no
// survey.
data::RigCamera FitCamera(const LensCamera& camera, const Eigen::Matrix3Xd& points,
                          double* rms_px = nullptr);

// Points spread over a box, the same for each seed.
Eigen::Matrix3Xd RandomPoints(const Eigen::Vector3d& low, const Eigen::Vector3d& high, int n,
                              std::uint64_t seed);

data::Rig FitRig(const VirtualRig& truth, const Eigen::Vector3d& low, const Eigen::Vector3d& high);

// The shipped layout as a rig of two-centre cameras.
const data::Rig& ShippedRig();

// A run of four marks in M's plane, without samples: columns x, y, vx, vy of each.
data::Run FourMarks();

// Marks on known ways that stay inside the shipped volume: swings and circles at about 1 m/s.
data::Run SwingingRun(double duration);

}  // namespace unfurl::measure
