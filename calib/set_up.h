#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/initial_guess.h"
#include "calib/observations.h"
#include "data/survey.h"

namespace unfurl::calib {

// A station that was moved stands, and is oriented, with an error of its own: all points measured
// from there are off by one rigid motion. Each set-up but the first has six common errors (of
// `CommonError`): a shift along x, y, z and a turn about x, y, z through the middle of its points,
//   surveyed = true + shift + turn x (true - middle) + noise,
// to first order. Their prior is weak: 30 median sigmas of a point, for the turn at the points' RMS
// distance from the middle. What prior and first order make wrong is told: SetUpEstimate::strain.
//
// First is the set-up with the most points, of several with as many the one named first: its frame
// is the rig's, and error bars relative to a frame are least where most points hold it. It must
// have three points that are not on one line.
//
// Lists them in out->set_ups and adds their errors to out->common; nothing where the survey names
// less than two, but for out->set_ups_told. Throws Error where none can be first, and for the place
// of one station beside several set-ups.
void AddSetUps(const data::Survey& survey, const std::string& where, Observations* out);

// GuessCameras. Where it refuses all points and does not without those of one set-up that is not
// the first, the Error names that set-up and by how much it is off (medians): so far that no fit of
// all begins.
std::vector<CameraGuess> GuessWithSetUps(const Observations& data, const GuessOptions& options,
                                         const std::string& where);

// The points of a set-up that is not the first, ascending.
std::vector<int> PointsOf(const Observations& data, int set_up);

/// What the fit made of a set-up that is not the first.
struct SetUpEstimate {
  std::string name, first;                           // and the one that holds the frame
  int points = 0;                                    // measured from it
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  // of them, in the first one's frame [m]
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();   // of its places there, as surveyed [m]
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();    // likewise, as a small vector [rad]
  // Of shift and turn [m, rad].
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  // Whether the points, by their number and places, tell all six: three that are not on one line.
  bool told = true;
  // What the prior's pull and the turn's second order may move any one number of the fit by, in its
  // sigmas, squared: the pull in the metric of the estimate, and the points' displacements in that
  // of the survey [-].
  double strain = 0.0;
  double chi_square = 0.0;  // of all six being zero, the prior taken off [-]
  double chance = 1.0;      // of as large a one where the set-up is not off [-]
  bool off = false;         // beyond chance, among all set-ups of the survey

  // Standard deviation of the length of a shift or turn along itself, or of the largest axis where
  // it is zero [m] or [rad].
  double ShiftSigma() const;
  double TurnSigma() const;
};

// `q` and `covariance` as EstimatesOf has them; `level`: with which probability any of faultless
// set-ups is called off.
std::vector<SetUpEstimate> SetUpsOf(const Observations& data, const Eigen::VectorXd& q,
                                    const Eigen::MatrixXd& covariance, double level);

// In words, for a verdict.
std::string TextOf(const SetUpEstimate& set_up);

}  // namespace unfurl::calib
