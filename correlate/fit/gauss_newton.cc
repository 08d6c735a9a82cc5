#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "correlate/fit/bounded_step.h"
#include "correlate/fit/solver.h"

namespace unfurl::correlate {

GaussNewton StepAndSigma(const Eigen::MatrixXd& projected, const Eigen::VectorXd& residual) {
  GaussNewton out;
  // Unit columns first: parameters of any units, and logarithms, share one normal matrix.
  Eigen::VectorXd size = projected.colwise().norm();
  for (double& s : size) s = s > 0.0 ? 1.0 / s : 0.0;
  const Eigen::MatrixXd unit = projected * size.asDiagonal();
  const Eigen::MatrixXd normal = unit.transpose() * unit;
  const auto decomposition = normal.completeOrthogonalDecomposition();
  out.step = -size.cwiseProduct(decomposition.solve(unit.transpose() * residual));
  const double dof = std::max(1.0, static_cast<double>(residual.size() - projected.cols()));
  const double scale = std::sqrt(std::max(1.0, residual.squaredNorm() / dof));
  out.sigma =
      scale * size.cwiseProduct(decomposition.pseudoInverse().diagonal().cwiseMax(0.0).cwiseSqrt());
  return out;
}

GaussNewton StepWithin(const std::vector<Parameter>& parameters, const std::vector<double>& u,
                       const Eigen::MatrixXd& projected, const Eigen::VectorXd& residual) {
  GaussNewton next = StepAndSigma(projected, residual);
  Eigen::VectorXd low(next.step.size()), high(next.step.size());
  bool inside = true;
  for (Eigen::Index j = 0; j < low.size(); ++j) {
    const auto i = static_cast<std::size_t>(j);
    low(j) = StepToLowest(parameters[i], u[i]);
    high(j) = StepToHighest(parameters[i], u[i]);
    inside = inside && next.step(j) >= low(j) && next.step(j) <= high(j);
  }
  if (!inside) {
    next.step =
        BoundedStep(projected.transpose() * projected, projected.transpose() * residual, low, high);
  }
  return next;
}

}  // namespace unfurl::correlate
