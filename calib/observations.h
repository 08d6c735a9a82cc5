#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "data/survey.h"

namespace unfurl::calib {

// A reading, a place or an error of which nothing is known.
inline constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// One number that one camera gave for one surveyed point.
struct Reading {
  int point = 0;
  int camera = 0;
  double u_px = 0.0;  // [px]
  double s_px = 0.0;  // standard deviation [px]
};

// An error that all surveyed points share: surveyed = true place + q shift + noise, with one q for
// all, N(0, 1) before the data speak (calib/common_error.h).
struct CommonError {
  std::string name;        // "distance offset"
  std::string unit;        // of sigma: m, 1 or rad
  double sigma = 0.0;      // as stated [unit]
  Eigen::Matrix3Xd shift;  // 3 x n, of the surveyed places, for one sigma [m]
  int set_up = -1;         // whose alone it is (Observations::set_ups); -1: of all points
};

// Points measured from one place of the station, in one orientation.
struct SetUp {
  std::string name;
  int points = 0;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  // of them; what it turns about [m]
  double arm = 0.0;                                  // their RMS distance from it [m]
  bool told = true;  // three that are not on one line: how it stood is to be told of them
};

// A survey as the bundle sees it: n points with their covariance, c cameras, and the readings that
// exist, ordered by point and then by camera.
struct Observations {
  std::vector<std::string> ids;      // n
  std::vector<std::string> cameras;  // c
  std::vector<int> pixels;           // c, of each sensor's row; 0, or empty: not stated
  std::vector<double> pitch;         // c, of the pixels [m]; 0, or empty: not stated
  Eigen::Matrix3Xd p;                // surveyed, 3 x n, in W [m]
  std::vector<Eigen::Matrix3d> cov;  // n [m^2]
  std::vector<Reading> readings;
  std::vector<CommonError> common;
  // Of a survey from several: the first holds the frame, the errors of the others are in `common`.
  std::vector<SetUp> set_ups;
  bool set_ups_told = false;  // the survey says from which each point was measured, one or several

  int points() const { return static_cast<int>(p.cols()); }              // n
  int camera_count() const { return static_cast<int>(cameras.size()); }  // c
  // Pixels of a camera's row as stated, or else as many as its readings ask for: up to the highest
  // that is no blunder.
  int RowOf(int camera) const;
};

// Takes the numbers of a survey that has readings (FindReadings makes them of lines). Throws Error,
// naming the point and `where` (the survey's file), for a covariance that is not positive definite,
// for a reading without a positive sigma and for a point that is a copy of another, and as
// SetUpErrorsOf (calib/set_up.h) does.
Observations FromSurvey(const data::Survey& survey, const std::string& where);

// Points `keep` (ascending), renumbered, with their readings.
Observations SelectPoints(const Observations& all, const std::vector<int>& keep);
// The readings of one camera, as a one-camera survey of all points.
Observations SelectCamera(const Observations& all, int camera);

}  // namespace unfurl::calib
