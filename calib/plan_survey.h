#pragma once

#include <Eigen/Core>
#include <cmath>
#include <string>

#include "data/survey.h"

namespace unfurl::calib {

/// How well a total station measures one point, by its data sheet; each point anew.
struct StationAccuracy {
  double offset = 0.0;  ///< of a distance [m]
  double scale = 0.0;   ///< of a distance, per metre of it [-]
  double angle = 0.0;   ///< of both directions [rad]
};

/// "1mm+0.1mm/m, 0.1mrad", "1.5mm+2ppm, 1arcsec": distance, then angles. Throws Error at `where`
/// for anything else.
StationAccuracy ParseStationAccuracy(const std::string& text, const std::string& where);

/// Gives each point that states no covariance the one that it has as measured from survey.station.
/// Throws Error where that place is not known, or is a point's.
void SetAccuracy(const StationAccuracy& accuracy, const std::string& where, data::Survey* survey);

/// By what planned points are measured.
struct PlannedStation {
  std::string accuracy;  ///< as ParseStationAccuracy's text; empty: what the points state
  std::string where = "--station";  ///< of `accuracy`, for messages
  /// Where it stands [m]; NaN: as the points say.
  Eigen::Vector3d at = Eigen::Vector3d::Constant(NAN);
  double sigma = 0.0;  ///< per axis, of points that nobody states one of [m]; 0: not known
};

/// Planned points, each with the covariance that it will have; `points` with their name for
/// messages. Throws Error where a point would have none.
data::Survey PlannedSurvey(data::Survey points, const PlannedStation& station,
                           const std::string& where);

}  // namespace unfurl::calib
