#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/bundle.h"
#include "calib/wand_data.h"
#include "data/rig.h"

namespace unfurl::calib {

/// All unknowns of a bundle with a bar. A mark at place s of the bar, `t` after the pose's time, is
/// at  middle + t velocity + s unit(direction + t turning).
struct WandState {
  std::vector<data::RigCamera> cameras;  // c
  Eigen::VectorXd place;                 // m, from the bar's middle as stated [m]
  Eigen::Matrix3Xd middle, direction;    // 3 x n: of the bar [m], [-]
  Eigen::Matrix3Xd velocity, turning;    // 3 x n; 0 where the marks flash at once [m/s], [1/s]
  Eigen::Matrix3Xd points;               // 3 x p, surveyed ones [m]
  Eigen::VectorXd common;                // of the survey's common errors, in their sigmas [-]

  // Of a mark, `after` the pose's time [s].
  Eigen::Vector3d Mark(int pose, int mark, double after) const;
  // Of the bar's outermost marks, at the poses' times, 3 x 2 n [m].
  Eigen::Matrix3Xd Ends() const;
};

/// How much each datum of a bundle with a bar counts.
struct WandWeighting {
  std::vector<double> floor_px;         // by camera, added in quadrature to each reading's sigma
  std::vector<char> use_reading;        // by reading of the bar; 0: left out
  std::vector<char> use_point_reading;  // by reading of a surveyed point
  std::vector<char> use_survey;         // by surveyed point
  // Of the bar's motion between poses: spectral density of its acceleration [m^2/s^3].
  double unrest = 0.0;
  // The frame is held to where the cameras stood at the start: nothing else fixes it.
  bool hold_frame = true;

  // Of a reading [px^2].
  double Variance(int camera, double s_px) const {
    const double floor = floor_px[static_cast<std::size_t>(camera)];
    return s_px * s_px + floor * floor;
  }
};

/// The normal equations at a solution, and what follows from them. Unknowns: those of all cameras,
/// 31 c in the order of data/rig.h, then the m - 1 places, then the survey's common errors; poses
/// and points are eliminated.
struct WandSystem {
  Eigen::MatrixXd information;            // of those unknowns, priors included
  Eigen::MatrixXd covariance;             // its inverse
  std::vector<double> redundancy;         // by reading of the bar, 0 where it takes no part [-]
  std::vector<double> point_redundancy;   // by reading of a surveyed point [-]
  std::vector<double> survey_redundancy;  // by surveyed point, of 3 [-]
  double motion_redundancy = 0.0;         // of the motion's residuals together [-]
  double motion_squares = 0.0;            // their squares, whitened [-]
  // By pose: variance of the bar's speed along itself, which stretches it between flashes
  // [m^2/s^2].
  std::vector<double> speed_variance;
};

/// How a bundle ended.
struct WandSummary {
  bool converged = false;
  int iterations = 0;
  double cost = 0.0;                      // half the sum that was minimised [-]
  std::vector<double> residual_px;        // reading less prediction; NaN: behind [px]
  std::vector<double> point_residual_px;  // of the surveyed points' readings [px]
};

// Minimises, over cameras, places, poses and points, the squares of readings of bar and points,
// surveyed places, stated places of the marks, the motion (neighbouring poses by white acceleration
// of density `unrest`, of the bar's ends about its middle the same), and the priors; readings and
// points by the loss of SolveBundle. Poses with fewer than 5 readings that take part are held by
// what they are linked to.
WandSummary SolveWandBundle(const WandData& data, const std::vector<CameraPrior>& priors,
                            const WandWeighting& weighting, const BundleOptions& options,
                            WandState* state, WandSystem* system);

}  // namespace unfurl::calib
