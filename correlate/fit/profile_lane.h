#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <vector>

namespace unfurl::correlate {

// One parameter held at one place, the others on their way to their best.
struct ProfileLane {
  std::size_t held = 0;
  double level = 0.0;         // signed, in standard errors
  std::vector<double> u;      // best so far
  std::vector<double> trial;  // being evaluated
  double cost = std::numeric_limits<double>::infinity();
  Eigen::VectorXd residual;  // at u
  Eigen::MatrixXd J;         // projected, at u_of_J; empty: the estimate's
  std::vector<double> u_of_J;
  double shrink = 1.0;
  int steps = 0, since_fresh = 0;
  bool done = false, settled = false, at_bound = false, failed = false;
};

}  // namespace unfurl::correlate
