#pragma once

#include <Eigen/Core>
#include <vector>

namespace unfurl::correlate {

/// Where a model does something at once (a rate that jumps, a peak as an impact leaves it) and does
/// it early or late, single residuals stick out that are no gross errors. By sample of a channel,
/// how far one may for that [sigmas]: twice what the model does there, or as much of it as the
/// residuals about let it be late by, and beside what is sharper than a sample, the difference to
/// the other side; 0 where the model does nothing at once.
/// `noise`: standard deviation of a residual against its neighbours'; all in sigmas.
std::vector<double> ExcusedAtOnce(const Eigen::VectorXd& model, const Eigen::VectorXd& residual,
                                  double noise);

}  // namespace unfurl::correlate
