#include "correlate/fit/clock_drift.h"

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "correlate/fit/autocorrelation.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

namespace {

// d residual / d drift of one part, in its rows.
Eigen::VectorXd DriftColumn(const ReducedProblem::Part& part, const Prediction& prediction,
                            const Registration& at, RegistrationOptions options) {
  Observations free = *part.observations;
  free.placement.drift = Prior::Free();
  options.max_iterations = 0;
  options.with_others = true;
  const RegistrationOptions fitted = WithPlacement(options, free);
  const Eigen::Index column = (fitted.fit_frame ? 6 : 0) + (fitted.fit_offset ? 1 : 0);
  return FitRegistration(free, prediction, part.reference, at, options, part.whitening)
      .jacobian.col(column);
}

}  // namespace

std::vector<DriftTest> TestClockDrift(const ReducedProblem& reduced,
                                      const ReducedProblem::Point& point, const Eigen::MatrixXd& J,
                                      const RegistrationOptions& options, double clock_sigma,
                                      double roughness) {
  // Of the column's square: what parameters and frame leave of it below that is round-off of the
  // differences that made their columns.
  constexpr double kOwn = 1e-8;
  constexpr double kMost = 3.0;  // of clock_sigma
  const Eigen::MatrixXd parameters = reduced.Project(point, J);
  const Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver(parameters);
  std::vector<DriftTest> out(reduced.parts().size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const ReducedProblem::Part& part = reduced.parts()[i];
    const Observations& o = *part.observations;
    if (o.placement.drift.kind != Foreknowledge::kUnsaid || options.fit_drift) continue;
    // 1. What of a drift no parameter, frame or offset imitates.
    const Eigen::VectorXd own =
        DriftColumn(part, *point.prediction[i], point.registration[i].at, options);
    Eigen::MatrixXd column = Eigen::MatrixXd::Zero(reduced.rows(), 1);
    column.middleRows(reduced.first_row(i), own.size()) = own;
    const Eigen::MatrixXd projected = reduced.Project(point, column);
    const Eigen::VectorXd left = projected - parameters * solver.solve(projected);
    const double square = left.squaredNorm();
    if (!(square > kOwn * own.squaredNorm())) continue;
    // Slopes that are known to a part leave that part of what they imitate, and it is no drift's.
    if (!(square > roughness * roughness * projected.squaredNorm())) continue;
    // 2. The step, and the noise that it leaves: a drift that is there must not be taken for noise.
    DriftTest& test = out[i];
    test.tested = true;
    test.drift = -left.dot(point.residual) / square;
    double variance = 0.0;
    for (std::size_t k = 0; k < out.size(); ++k) {
      const Observations& other = *reduced.parts()[k].observations;
      const RowLayout layout(other);
      const Eigen::Index first = reduced.first_row(k);
      const Eigen::VectorXd d = left.segment(first, layout.rows);
      const Eigen::VectorXd r = point.residual.segment(first, layout.rows) + test.drift * d;
      variance += EstimateResidualNoise(other, r).Middle(d)(0, 0);
      variance +=
          layout.IndependentGram(d)(0, 0) + d.tail(layout.rows - layout.draws).squaredNorm();
    }
    test.sigma = std::sqrt(variance) / square;
    test.deviance = test.drift * test.drift / (test.sigma * test.sigma);
    // 3. One parameter more by the Bayesian information criterion [Schwarz 1978].
    const bool wanted =
        test.deviance > std::log(std::max(2.0, static_cast<double>(reduced.rows())));
    test.too_large = wanted && std::abs(test.drift) > kMost * clock_sigma;
    test.called = wanted && !test.too_large;
  }
  return out;
}

}  // namespace unfurl::correlate
