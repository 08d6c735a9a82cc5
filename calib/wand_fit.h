#pragma once

#include <string>
#include <vector>

#include "base/pose.h"
#include "calib/bundle.h"
#include "calib/initial_guess.h"
#include "calib/known_lens.h"
#include "calib/wand_bundle.h"
#include "calib/wand_data.h"
#include "calib/wand_guess.h"

namespace unfurl::calib {

/// Of the fit of cameras and poses.
struct WandFitOptions {
  GuessOptions guess;      // of each camera, once marks are known
  WandGuessOptions start;  // from nothing
  BundleOptions bundle;    // of the robust stage
  // A reading whose residual exceeds so many of its own sigmas is left out as gross; in a pose the
  // largest first. Chance reaches 4 in one of 16,000 readings [-].
  double gross_sigmas = 4.0;
  // Terms of the lens: an index into the orders of its model (measure::OrdersOf); below 0: the
  // usual ones (measure::UsualOrderOf).
  int order = -1;
  // Of gross errors and variances, at most: of glass that no terms follow the ends of the rows go a
  // layer in each, and 24 of them were not the last (decision 294).
  int rounds = 12;
  int search_poses = 150;  // that the first cameras are found from; the rest follow [-]
  // Where the cameras stand, about, by name: an earlier rig, or where they were meant to. Empty:
  // they are found from nothing.
  std::vector<data::RigCamera> from;
  // Lenses of the same cameras from a calibration before they were moved, all or none: in the place
  // of guess.lens, order and the priors of e and the terms.
  std::vector<KnownLens> lenses;

  // Throws Error that names a value which makes no sense.
  void Check() const;
};

/// Other cameras and poses that explain the readings as well: what was found is not determined.
struct WandRival {
  double apart = 0.0;  // RMS distance of the bar's ends, after the best motion or mirror image [m]
  double worse = 0.0;  // sum of squared whitened residuals, less that of the fit [-]
};

/// Cameras and poses from the bar's readings, in a frame that nothing has fixed yet, or the
/// survey's where it has points enough.
struct WandFit {
  WandData data;    // the poses that take part
  int dropped = 0;  // poses that too few cameras see
  // Poses that contradict the rest and take no part, and of each camera (c, or none) their
  // readings.
  std::vector<std::string> lost_poses;
  std::vector<int> lost_readings;
  std::vector<CameraPrior> priors;
  std::vector<CameraPrior> richest;  // with every term; empty where a set of terms was asked for
  WandWeighting weighting;
  WandState state;
  WandSummary summary;
  WandSystem system;
  std::vector<WandRival> rivals;
  bool settled = false;    // variances and what is left out changed no more
  bool by_points = false;  // the frame is the survey's
  // The rig is told from its mirror image: by surveyed points off a plane, or by known lenses.
  bool handed = false;

  // Rows of `system.covariance` that are the cameras'; those of the marks' places follow.
  Eigen::Index CameraNumbers() const;
  // Of the cameras' parameters, 31 c x 31 c, in the frame that holds in the fit.
  Eigen::MatrixXd CameraCovariance() const;
};

// First guess (calib/wand_guess), robust bundle, the survey's frame where three points or more fix
// it, then least squares of what is believed in turn with floors, unrest of the bar and gross
// errors. Throws Error for data that no cameras explain.
WandFit FitWand(const WandData& data, const WandFitOptions& options, const std::string& where);

// The same data with other poses, from a fit that is near, nothing left out anew.
void RefitWand(const BundleOptions& options, WandFit* fit);

// A camera that sees the mirror image of what it saw, about the origin, with the same readings.
data::RigCamera Mirrored(const data::RigCamera& camera);
// The fit in another frame, p' = X p; `mirror`: after p -> -p. Its system is not changed.
void MoveWand(const Pose& X, bool mirror, WandFit* fit);

}  // namespace unfurl::calib
