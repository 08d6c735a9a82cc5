#include "correlate/align/stated.h"

#include <fmt/format.h>

#include <cmath>

#include "base/dense.h"
#include "base/number.h"
#include "base/statistics.h"
#include "correlate/align/nuisance.h"
#include "correlate/fit/goodness.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

namespace {

Stated ScalarOf(std::string name, std::string unit, const Prior& prior, Eigen::Index row,
                const Eigen::VectorXd& residual) {
  Stated out;
  out.name = std::move(name), out.unit = std::move(unit);
  out.mean = prior.mean, out.sigma = prior.sigma;
  out.value = prior.mean + residual(row) * prior.sigma;
  out.row = row;
  return out;
}

// Those of the residual kinds: a row without a stamp, of one unknown.
void AddKinds(const Observations& o, const RegistrationFit& fit, const RegistrationOptions& options,
              const RowLayout& layout, std::vector<Stated>* out) {
  const std::vector<Nuisance> nuisances = Nuisances(options, o);
  std::vector<Eigen::Index> columns;
  for (std::size_t c = 0; c < nuisances.size(); ++c) {
    if (nuisances[c].kind == Nuisance::Kind::kOwn) columns.push_back(static_cast<Eigen::Index>(c));
  }
  for (std::size_t k = 0; k < o.others.size(); ++k) {
    for (Eigen::Index i = 0; i < o.others[k]->rows(); ++i) {
      if (!std::isnan(o.others[k]->TimeOf(i))) continue;
      const Eigen::Index row = layout.others[k] + i;
      for (Eigen::Index c : columns) {
        const double slope = fit.jacobian(row, c);
        if (slope == 0.0) continue;
        const Nuisance& of = nuisances[static_cast<std::size_t>(c)];
        const double value = ValueOf(of, fit), sigma = 1.0 / std::abs(slope);
        const Prior prior = Prior::Normal(value - fit.residual(row) * sigma, sigma);
        out->push_back(ScalarOf(of.Name(), of.Unit(), prior, row, fit.residual));
      }
    }
  }
}

}  // namespace

std::vector<Stated> StatedOf(const Observations& observations, const Placement& placement,
                             const RegistrationFit& fit, const RegistrationOptions& options) {
  std::vector<Stated> out;
  const RowLayout layout(observations);
  const RegistrationOptions fitted = WithPlacement(options, observations);
  if (fitted.with_others) AddKinds(observations, fit, fitted, layout, &out);
  Eigen::Index row = layout.priors;
  const Placement& used = observations.placement;
  if (used.frame.kind == Foreknowledge::kNormal && fitted.fit_frame) {
    Stated frame;
    frame.name = "frame", frame.row = row, frame.rows = 6;
    out.push_back(frame);
    row += 6;
  }
  if (used.offset.kind == Foreknowledge::kNormal) {
    out.push_back(ScalarOf("time offset", "s", placement.offset, row++, fit.residual));
  }
  if (placement.drift.kind == Foreknowledge::kNormal) {
    out.push_back(ScalarOf("clock drift", "1", placement.drift, row, fit.residual));
  }
  return out;
}

void HoldAgainstData(const Eigen::MatrixXd& A, const Eigen::VectorXd& residual,
                     const Eigen::MatrixXd& inverse, const Eigen::MatrixXd& covariance,
                     double tolerance, std::vector<Stated>* stated) {
  // Of a variance of 1: what rounding leaves where the data say nothing.
  constexpr double kFloor = 1e-9;
  const double level = ChanceOfEach(kGoodnessLevel, static_cast<double>(stated->size()));
  for (Stated& s : *stated) {
    const Eigen::MatrixXd rows = A.middleRows(s.row, s.rows);
    const Eigen::VectorXd r = residual.segment(s.row, s.rows);
    const Eigen::MatrixXd known = rows * inverse * rows.transpose();
    const Eigen::MatrixXd left = Eigen::MatrixXd::Identity(s.rows, s.rows) - known;
    const Eigen::MatrixXd spread =
        left + rows * (covariance - inverse) * rows.transpose() + tolerance * tolerance * known;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> of_spread(spread), of_left(left);
    const Eigen::VectorXd along = of_spread.eigenvectors().transpose() * r;
    s.p_value = ChiSquareTail(
        along.cwiseAbs2().cwiseQuotient(of_spread.eigenvalues().cwiseMax(kFloor)).sum(),
        static_cast<double>(s.rows));
    s.contradicted = s.p_value < level;
    Eigen::VectorXd alone = of_left.eigenvectors().transpose() * r;
    alone = alone.cwiseQuotient(of_left.eigenvalues().cwiseMax(kFloor));
    s.shift = inverse * rows.transpose() * (of_left.eigenvectors() * alone);
    s.without = s.mean + s.sigma * (r + rows * s.shift)(0);
  }
}

std::string ContradictionWords(const Stated& s, const std::string& of) {
  constexpr double kLeast = 1e-12;  // what rounding leaves of 1 - p [-]
  const std::string chance =
      s.p_value < kLeast ? fmt::format("below {:.0e}", kLeast) : fmt::format("{:.2g}", s.p_value);
  const std::string unit = UnitAfter(s.unit);
  const bool one = std::isfinite(s.mean);
  return fmt::format(
      "What was stated beforehand of {}{}{}{} and the data contradict each other (so far apart by "
      "chance: {}){}. One of the two is wrong.",
      s.parameter ? "" : "the ", s.name, of,
      one ? fmt::format(", {}{},", NumberWithError(s.mean, s.sigma), unit) : std::string(), chance,
      one ? fmt::format(": by the data alone it is about {:.6g}{}", s.without, unit)
          : std::string());
}

}  // namespace unfurl::correlate
