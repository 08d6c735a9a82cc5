#pragma once

#include <string>
#include <vector>

#include "calib/bundle.h"
#include "calib/observations.h"
#include "data/rig.h"

namespace unfurl::calib {

// A direction in a camera's parameters that the survey does not determine to within what one would
// notice: 1 mrad of rotation; 0.3% of the distance to the volume of place (10 mm at 3 m) and 0.15%
// of the distance between the two centres; 0.1% of image scale; 0.1% of the row of offset, 0.05% at
// the edge of the field of a term.
struct WeakDirection {
  int camera = 0;
  std::string name;        // "along its lens axis", or what changes together
  double sigma = 0.0;      // of its main parameter [unit]
  std::string unit;        // "m", "rad", "px"
  double by_prior = 0.0;   // share of what is known of it that the priors supply [-]
  double point_rms = 0.0;  // by how much one sigma of it moves found points of the volume [m]
  bool harmless = false;   // against all that the calibration does to points
  std::string advice;      // what to measure, or that nothing need be done
};

// The rank test: eigenvectors of each camera's covariance in the units above, those with a standard
// deviation above 1, widest first. `information` holds the priors, `covariance` is its inverse.
std::vector<WeakDirection> FindWeak(const data::Rig& rig, const std::vector<CameraPrior>& priors,
                                    const Eigen::MatrixXd& information);

// What the survey's layout leaves to be wished: points near one plane, parts of a sensor without
// readings, few points. Sentences that say what to measure; empty where all is well.
// `priors`: of the fit that `rig` is of. `lenses_known`: from a calibration before, which had the
// rest of each row.
std::vector<std::string> SurveyAdvice(const Observations& data, const Weighting& weighting,
                                      const data::Rig& rig, const std::vector<CameraPrior>& priors,
                                      bool lenses_known = false);

// Of the calibration's part alone, over a grid of the volume, where enough cameras see [m]; 0 where
// no point is.
double CalibrationErrorRms(const data::Rig& rig);

}  // namespace unfurl::calib
