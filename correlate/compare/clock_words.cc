#include "correlate/compare/clock_words.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/fixed_number.h"
#include "base/number.h"
#include "correlate/align/stated.h"
#include "correlate/fit/normal_matrix.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

std::vector<std::string> ClockWords(const Comparison& c, const std::string& found,
                                    const std::string& then) {
  const Alignment& a = c.alignment;
  const Prior& known = c.observations.placement.offset;
  std::vector<std::string> out;
  if (known.kind == Foreknowledge::kKnown) {
    out.push_back(
        fmt::format("The record's clock shows {} s when the reference's shows 0: that was known, "
                    "and not sought.",
                    a.at.offset));
  } else {
    out.push_back(fmt::format(
        "The record's clock shows {} s when the reference's shows 0: found from {}{}{}.",
        NumberWithError(a.at.offset, a.Sigma("time offset"), 6), found,
        known.kind == Foreknowledge::kNormal
            ? fmt::format(" and what was known, {} s", NumberWithError(known.mean, known.sigma, 6))
            : std::string(),
        then));
  }
  if (a.drift == 0.0) return out;
  const std::string by =
      a.Sigma("clock drift") > 0.0
          ? NumberWithError(1e6 * std::abs(a.drift), 1e6 * a.Sigma("clock drift"))
          : fmt::format("{:g} (known)", 1e6 * std::abs(a.drift));
  out.push_back(fmt::format(
      "The record's clock runs {} by {} parts in a million; that is taken out, about {} s.",
      a.drift > 0.0 ? "fast" : "slow", by, FixedNumber(a.drift_pivot, 3)));
  return out;
}

std::vector<std::string> ContradictionsOf(const Observations& o, const Alignment& a) {
  std::vector<std::string> out;
  const bool unscaled = !o.marks.empty() && !o.has_sigma;  // residuals have no size to judge by
  const Eigen::Index unknowns = a.fit.jacobian.cols();
  if (unscaled || unknowns == 0 || a.covariance.cols() != unknowns) return out;
  // An alignment ends where clock and frame move by less than a tenth of their standard errors.
  constexpr double kLetPass = 0.1;
  // Samples of marks may have been left out before; what was stated stands behind them.
  const Eigen::Index rows = RowLayout(o).rows, same = std::min(rows, a.fit.jacobian.rows());
  RegistrationFit fit = a.fit;
  fit.jacobian = Eigen::MatrixXd::Zero(rows, unknowns);
  fit.jacobian.bottomRows(same) = a.fit.jacobian.bottomRows(same);
  fit.residual = Eigen::VectorXd::Zero(rows);
  const Eigen::Index shown = std::min(rows, a.fit.residual.size());
  fit.residual.tail(shown) = a.fit.residual.tail(shown);
  RegistrationOptions options;
  options.with_others = o.marks.empty();
  std::vector<Stated> stated = StatedOf(o, o.placement, fit, options);
  Eigen::MatrixXd open;
  const Eigen::MatrixXd inverse = InverseOfNormal(Gram(a.fit.jacobian), &open);
  HoldAgainstData(fit.jacobian, fit.residual, inverse, a.covariance, kLetPass, &stated);
  for (const Stated& s : stated) {
    if (s.contradicted) out.push_back(ContradictionWords(s, ""));
  }
  return out;
}

}  // namespace unfurl::correlate
