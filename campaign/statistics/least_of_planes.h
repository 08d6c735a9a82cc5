#pragma once

#include <Eigen/Core>

namespace unfurl::campaign {

/// The least of several linear functions, as the margin of what fails in one of several ways is
/// near to be.
struct LeastOfPlanes {
  Eigen::MatrixXd coefficients;  // (1 + d) x planes: constant, slopes
  double error = 0.0;            // root mean square of leave-one-out residuals of margins <= near

  double At(const Eigen::VectorXd& z) const {
    return (coefficients.row(0).transpose() +
            coefficients.bottomRows(coefficients.rows() - 1).transpose() * z)
        .minCoeff();
  }
};

/// By least squares on the points of which each plane is the least, in turn with finding those
/// [Magnani and Boyd 2009]; from one plane on, each next begun with the points that lie farthest
/// below. Of all numbers of planes that leave `points_each` points to a coefficient, that with the
/// least error; error infinite where there are too few points for one.
LeastOfPlanes FitLeastOfPlanes(const Eigen::MatrixXd& points, const Eigen::VectorXd& margins,
                               double near, int points_each);

}  // namespace unfurl::campaign
