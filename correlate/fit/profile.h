#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <vector>

#include "correlate/fit/reduced_problem.h"

namespace unfurl::correlate {

/// Of all profiles of a fit.
struct ProfileOptions {
  bool wanted = true;
  // Where each parameter is held, in standard errors of the data to either side.
  std::vector<double> levels = {1.0, 2.0};
  // Evaluations of all profiles together; what is left open then is said to be.
  int max_evaluations = 400;
};

/// One value at which a parameter was held.
struct ProfilePoint {
  double value = 0.0;         // of the parameter [unit]
  double deviance = 0.0;      // twice the rise of the cost with all others at their best [-]
  std::vector<double> theta;  // all parameters there [units]
  bool settled = false;       // the others' best was found, to 0.01 to 0.1 of deviance
};

// Profile likelihood of one parameter: it is held at values to either side and all others (and
// frame, offset, calibration) are fitted anew [Venzon and Moolgavkar 1988; Raue et al. 2009].
struct Profile {
  std::vector<ProfilePoint> points;  // rising in value, the estimate among them
  // 95% interval of the data: deviance 3.84 times `dispersion`; NaN where the profile does not
  // rise to it as far as it could be followed, or a bound comes first.
  double low = std::numeric_limits<double>::quiet_NaN();   // [unit]
  double high = std::numeric_limits<double>::quiet_NaN();  // [unit]
  double dispersion = 1.0;  // what residual correlation that is left adds to the variance [-]
  double reached_low = 0.0, reached_high = 0.0;  // how far it was followed [unit]
  // An open side was lost, or the budget spent, before a bound or twice KnownWithin.
  bool lost_low = false, lost_high = false;
  bool closed() const { return low == low && high == high; }
};

// What a profile starts from: the estimate, sensitivities there and what they say.
struct ProfileStart {
  std::vector<double> u;  // the estimate [-]
  ReducedProblem::Point point;
  Eigen::MatrixXd projected;   // rows x p, d residual / d u, nuisances projected out [-]
  Eigen::VectorXd sigma;       // of each u, of the data [-]
  Eigen::VectorXd dispersion;  // variance of the data over that of the rows alone, >= 1 [-]
  double scatter = 0.0;        // sum of squares of the model's own in all rows [-]
};

// All parameters' profiles, simulations of all of them in common batches. A profile that has not
// risen to the 95% level is followed on, each point from the ones before it, until a bound, twice
// KnownWithin, or the budget; where the others' best is lost on the way, by shorter steps.
std::vector<Profile> Profiles(ReducedProblem& problem, const ProfileStart& start,
                              const ProfileOptions& options);

// 95% quantile of chi-square with one degree of freedom.
inline constexpr double kDeviance95 = 3.841458820694124;

}  // namespace unfurl::correlate
