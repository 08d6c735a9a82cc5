#pragma once

#include <Eigen/Core>
#include <cmath>

#include "correlate/observations.h"

namespace unfurl::correlate {

// Whether the model has an answer for sample i.
inline bool Known(const MarkMotion& motion, Eigen::Index i) {
  return motion.known.empty() || motion.known[static_cast<std::size_t>(i)] != 0;
}

// The inverse of the lower Cholesky factor of a sample's covariance, the reference's included.
inline Eigen::Matrix3d Whitener(const MarkSeries& series, const MarkMotion& motion, Eigen::Index i,
                                const Eigen::Matrix3d& R_WM) {
  Eigen::Matrix3d cov = Symmetric(series.cov.col(i));
  if (motion.cov.cols() > 0) cov += R_WM * Symmetric(motion.cov.col(i)) * R_WM.transpose();
  // Written out: this is called for every sample of every iteration.
  Eigen::Matrix3d W = Eigen::Matrix3d::Zero();
  const double l00 = std::sqrt(cov(0, 0));
  const double l10 = cov(1, 0) / l00, l20 = cov(2, 0) / l00;
  const double l11 = std::sqrt(cov(1, 1) - l10 * l10);
  const double l21 = (cov(2, 1) - l20 * l10) / l11;
  const double l22 = std::sqrt(cov(2, 2) - l20 * l20 - l21 * l21);
  W(0, 0) = 1.0 / l00;
  W(1, 1) = 1.0 / l11;
  W(2, 2) = 1.0 / l22;
  W(1, 0) = -l10 * W(0, 0) * W(1, 1);
  W(2, 1) = -l21 * W(1, 1) * W(2, 2);
  W(2, 0) = -(l20 * W(0, 0) + l21 * W(1, 0)) * W(2, 2);
  return W;
}

}  // namespace unfurl::correlate
