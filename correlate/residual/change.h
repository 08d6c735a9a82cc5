#pragma once

#include <Eigen/Core>
#include <vector>

#include "correlate/model.h"
#include "correlate/observations.h"

namespace unfurl::correlate {

/// By how much one prediction differs from another at the same stamps, or what they do per unit of
/// a parameter: all that residuals respond to.
struct Change {
  std::vector<Eigen::Matrix3Xd> marks;  ///< of each mark, 3 x n, in the model's frame [m]
  std::vector<Eigen::VectorXd> others;  ///< numbers of each residual kind

  /// There is none.
  bool empty() const { return marks.empty() && others.empty(); }
};

/// `factor` times (to - from). Numbers that either has not: 0.
Change Difference(const Observations& observations, const Prediction& from, const Prediction& to,
                  double factor = 1.0);
/// a + factor * b.
Change Sum(const Change& a, double factor, const Change& b);
/// factor * a.
Change Scaled(const Change& a, double factor);

}  // namespace unfurl::correlate
