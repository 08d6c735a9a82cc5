#include <algorithm>
#include <cmath>

#include "correlate/fit/fit_covariance.h"
#include "correlate/fit/normal_matrix.h"

namespace unfurl::correlate {

void FillProfiles(const FitProblem& problem, ReducedProblem& reduced, const std::vector<double>& u,
                  const ReducedProblem::Point& point, const FitOptions& options,
                  const std::vector<double>& noise, FitResult* r) {
  const auto p = static_cast<Eigen::Index>(u.size());
  ProfileStart start;
  for (std::size_t i = 0; i < point.registration.size(); ++i) {
    const double rows = static_cast<double>(point.registration[i].data_rows);
    start.scatter += rows * noise[reduced.parts()[i].trial] * noise[reduced.parts()[i].trial];
  }
  start.u = u;
  start.point = point;
  Eigen::MatrixXd J = r->sensitivity;
  for (Eigen::Index j = 0; j < p; ++j) {
    const auto i = static_cast<std::size_t>(j);
    J.col(j) *= Slope(problem.parameters[i], r->parameters[i].value);
  }
  start.projected = reduced.Project(point, J);
  Eigen::MatrixXd open;
  Eigen::MatrixXd inverse = InverseOfNormal(start.projected.transpose() * start.projected, &open);
  inverse += open;
  start.sigma.resize(p);
  start.dispersion.resize(p);
  for (Eigen::Index j = 0; j < p; ++j) {
    const auto i = static_cast<std::size_t>(j);
    const Parameter& q = problem.parameters[i];
    const double slope = Slope(q, r->parameters[i].value);
    const double bread = std::sqrt(std::max(inverse(j, j), 1e-300));
    const double own = r->parameters[i].sigma_data / std::max(std::abs(slope), 1e-300);
    start.dispersion(j) = std::clamp(own * own / (bread * bread), 1.0, 1e6);
    // Where the linear model knows nothing: a twentieth of the bounds.
    const double range = std::isfinite(q.high - q.low) ? (q.high - q.low) / std::abs(slope)
                         : q.log                       ? std::max(1.0, q.start / slope)
                                                       : std::max(1.0, std::abs(u[i]));
    start.sigma(j) = std::min(bread * std::sqrt(start.dispersion(j)), 0.05 * range);
  }
  std::vector<Profile> profiles = Profiles(reduced, start, options.profile);
  for (std::size_t j = 0; j < profiles.size(); ++j) {
    r->parameters[j].profile = std::move(profiles[j]);
  }
}

}  // namespace unfurl::correlate
