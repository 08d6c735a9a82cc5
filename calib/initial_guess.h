#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "calib/bundle.h"
#include "calib/known_lens.h"
#include "calib/observations.h"
#include "data/rig.h"

namespace unfurl::calib {

/// Of the search for each camera without a start.
struct GuessOptions {
  // Fewest readings of one camera. The linear pinhole has 7 unknowns; 12 leave something to reject
  // a gross error with.
  int fewest_points = 12;
  // A survey whose smallest standard deviation in any direction is below this share of its largest
  // counts as flat: one plane (or line) does not tell image scale from distance.
  double flatness = 0.05;  // [-]
  data::LensModel lens = data::LensModel::kRectilinear;
  // Prior of the distance between the two centres [m]. 0: a cylinder lens in front of a linear CCD
  // has it near its focal length, f times the pixels' pitch; where the pitch is not stated, a
  // share of the distance to the points, as far as a lens can focus.
  double e_mean = 0.0, e_sigma = 0.0;
  // Prior of the position along the lens axis, about where the points' centre has Y = 0, as a share
  // of the distance to that centre: the camera was pointed at the volume to within some 17 degrees.
  double along_sigma_share = 0.3;  // [-]
  // Priors of the terms, in those of the lens model (measure::PriorOf) [-].
  double term_sigmas = 1.0;
  std::uint64_t seed = 1;  // of the random subsets
  // Of the same cameras from a calibration before, by name, all or none: each is first thought
  // where it was, its lens known as well as that calibration knows it, and few points tell where it
  // is now. Takes the place of `lens` and of the priors of e and the terms.
  std::vector<KnownLens> known;
  // Fewest readings of a camera whose lens is known: six unknowns, and two to find an error with.
  int fewest_with_lens = 8;

  // Throws Error that names a value which makes no sense.
  void Check() const;
};

// A camera found from its readings alone, with the survey taken as exact.
struct CameraGuess {
  data::RigCamera camera;
  CameraPrior prior;      // of the terms that fits start with (measure::UsualOrderOf)
  CameraPrior richest;    // the same with every term
  double sigma_px = 0.0;  // robust scale of its residuals [px]
  int readings = 0;
};

// For each camera: the robust direct linear transformation, then its own parameters by robust
// least squares with the loss's scale taken from the residuals (twice). Needs no starting values.
// Where lenses are known, from where each camera was, too, whichever misses its readings less.
// Throws Error, naming camera and reason, for too few readings, points that are coplanar or
// collinear, readings that no camera explains, and two cameras with the very same readings.
std::vector<CameraGuess> GuessCameras(const Observations& data, const GuessOptions& options,
                                      const std::string& where);

// How the points lie: standard deviations along their principal axes, largest first [m], and the
// direction of the least one.
struct PointSpread {
  Eigen::Vector3d sigma;   // [m]
  Eigen::Vector3d normal;  // [-]
};
PointSpread SpreadOf(const Eigen::Matrix3Xd& p);

}  // namespace unfurl::calib
