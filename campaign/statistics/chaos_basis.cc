#include "campaign/statistics/chaos_basis.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/statistics.h"

namespace unfurl::campaign {

namespace {

// Adds to `term` factors of inputs from `first` on.
void Extend(int first, int dimensions, double left, double q, int interaction, std::size_t most,
            ChaosTerm* term, std::vector<ChaosTerm>* terms) {
  if (interaction == 0 || terms->size() > most) return;
  constexpr double kRounding = 1e-9;  // of the norm, where a term lies on the limit itself
  for (int d = first; d < dimensions; ++d) {
    for (int degree = 1; std::pow(degree, q) <= left + kRounding; ++degree) {
      term->emplace_back(d, degree);
      terms->push_back(*term);
      Extend(d + 1, dimensions, left - std::pow(degree, q), q, interaction - 1, most, term, terms);
      term->pop_back();
      if (terms->size() > most) return;
    }
  }
}

}  // namespace

std::vector<ChaosTerm> TermsOf(int dimensions, int degree, double truncation, int interaction,
                               std::size_t most) {
  std::vector<ChaosTerm> terms = {{}};
  ChaosTerm term;
  Extend(0, dimensions, std::pow(degree, truncation), truncation, interaction, most, &term, &terms);
  if (terms.size() > most) terms.clear();
  return terms;
}

void Polynomials(ChaosBasis basis, double u, int degree, double* values) {
  values[0] = 1.0;
  if (degree == 0) return;
  if (basis == ChaosBasis::kLegendre) {
    const double x = 2.0 * u - 1.0;
    values[1] = x;
    for (int k = 1; k < degree; ++k) {
      values[k + 1] = ((2.0 * k + 1.0) * x * values[k] - k * values[k - 1]) / (k + 1.0);
    }
    for (int k = 1; k <= degree; ++k) values[k] *= std::sqrt(2.0 * k + 1.0);
    return;
  }
  const double z = NormalQuantile(u);
  values[1] = z;  // normalised as it goes: He_(k+1) = z He_k - k He_(k-1), over sqrt((k+1)!)
  for (int k = 1; k < degree; ++k) {
    values[k + 1] = (z * values[k] - std::sqrt(k) * values[k - 1]) / std::sqrt(k + 1.0);
  }
}

Eigen::MatrixXd TermValues(ChaosBasis basis, const std::vector<ChaosTerm>& terms, int degree,
                           const Eigen::MatrixXd& points) {
  const Eigen::Index n = points.cols(), d = points.rows();
  Eigen::MatrixXd columns = Eigen::MatrixXd::Ones(n, static_cast<Eigen::Index>(terms.size()));
  Eigen::MatrixXd single(degree + 1, d);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index k = 0; k < d; ++k) {
      Polynomials(basis, points(k, i), degree, single.col(k).data());
    }
    for (std::size_t t = 0; t < terms.size(); ++t) {
      double product = 1.0;
      for (const auto& [input, power] : terms[t]) product *= single(power, input);
      columns(i, static_cast<Eigen::Index>(t)) = product;
    }
  }
  return columns;
}

Pursuit Pursue(const Eigen::MatrixXd& columns, const Eigen::VectorXd& values) {
  const Eigen::Index n = columns.rows();
  // Of as many terms as that each still has three runs; the norm of what is left of a column that
  // the picked ones span is rounding.
  const Eigen::Index most =
      std::min<Eigen::Index>(columns.cols(), std::max<Eigen::Index>(n / 3, 1));
  constexpr double kSpanned = 1e-8;  // of its own norm
  Eigen::MatrixXd q(n, most);        // orthonormal, of the columns picked
  Eigen::VectorXd residual = values, leverage = Eigen::VectorXd::Zero(n);
  const Eigen::VectorXd norms = columns.colwise().norm().transpose();
  std::vector<bool> taken(static_cast<std::size_t>(columns.cols()));
  Pursuit best, now;
  best.criterion = std::numeric_limits<double>::infinity();
  for (Eigen::Index k = 0; k < most; ++k) {
    // The constant first; then the column with the largest correlation.
    Eigen::Index pick = 0;
    if (k > 0) {
      Eigen::VectorXd correlation =
          (columns.transpose() * residual).cwiseAbs().cwiseQuotient(norms);
      for (Eigen::Index c = 0; c < columns.cols(); ++c) {
        if (taken[static_cast<std::size_t>(c)]) correlation[c] = -1.0;
      }
      if (correlation.maxCoeff(&pick) <= 0.0) break;
    }
    taken[static_cast<std::size_t>(pick)] = true;
    Eigen::VectorXd v = columns.col(pick);
    for (int pass = 0; pass < 2; ++pass) {  // once more against rounding
      v -= q.leftCols(k) * (q.leftCols(k).transpose() * v);
    }
    const double norm = v.norm();
    if (norm <= kSpanned * norms[pick]) {
      q.col(k).setZero();
      continue;
    }
    q.col(k) = v / norm;
    residual -= q.col(k) * q.col(k).dot(residual);
    leverage += q.col(k).cwiseAbs2();
    now.picked.push_back(static_cast<int>(pick));
    constexpr double kOwn = 1e-12;  // a run that decides a coefficient alone tells nothing of it
    now.loo_error = (residual.array() / (1.0 - leverage.array()).max(kOwn)).square().mean();
    const double count = static_cast<double>(now.picked.size()), runs = static_cast<double>(n);
    now.criterion = now.loo_error * runs / (runs - count) * (1.0 + count / runs);
    if (now.criterion < best.criterion) best = now;
    // No better for a tenth of the terms: it has begun to follow noise.
    if (now.picked.size() > best.picked.size() + best.picked.size() / 10 + 10) break;
    if (residual.squaredNorm() <= 1e-28 * values.squaredNorm()) break;  // exact
  }
  return best;
}

}  // namespace unfurl::campaign
