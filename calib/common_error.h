#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/observations.h"
#include "data/survey.h"

namespace unfurl::calib {

// What a total station does to all points alike, as Survey::station_errors states it: an offset and
// a scale of its distances, an index error of its vertical circle. What of that is a rigid motion
// of the surveyed points (least squares) is the frame W itself and is taken off: the rest bends or
// stretches the survey, and everything that is found with it. Of refraction nothing is left within
// a room: 0.13 d^2 / (2 * 6370 km), a quarter of a micrometre at 5 m. Its orientation, place and
// level are the frame.
// Empty where none is stated. Throws Error where one is and the station's place is not known.
std::vector<CommonError> StationErrorsOf(const data::Survey& survey, const std::string& where);

// 3 x n, without the best rigid motion of the points p by least squares (first order) [m].
Eigen::Matrix3Xd WithoutRigidMotion(const Eigen::Matrix3Xd& p, const Eigen::Matrix3Xd& shift);

// Of point i, for q in sigmas; q may be empty: none.
Eigen::Vector3d CommonShift(const Observations& data, const Eigen::VectorXd& q, Eigen::Index i);
// The survey with q's shifts taken off the points; what is common stays listed.
Observations Corrected(Observations data, const Eigen::VectorXd& q);

// What the fit made of a common error.
struct CommonEstimate {
  std::string name, unit;
  double stated_sigma = 0.0;        // [unit]
  double value = 0.0, sigma = 0.0;  // [unit]
  std::string set_up;               // whose it is alone; empty: of all points
};
// `covariance` is of cameras and common errors together, as CameraCovariance gives it.
std::vector<CommonEstimate> EstimatesOf(const Observations& data, const Eigen::VectorXd& q,
                                        const Eigen::MatrixXd& covariance);

}  // namespace unfurl::calib
