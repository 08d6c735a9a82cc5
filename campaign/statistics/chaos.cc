#include "campaign/statistics/chaos.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/count.h"
#include "base/dense.h"
#include "base/error.h"
#include "base/statistics.h"
#include "campaign/statistics/chaos_basis.h"
#include "campaign/statistics/counter_random.h"

namespace unfurl::campaign {

namespace {

constexpr std::size_t kMostTerms = 1500;  // candidates: beyond them pursuit takes minutes
constexpr double kMostNumbers = 2e7;      // candidates times runs, 160 MB
constexpr std::uint64_t kFolds = 5;       // each fit then has 80% of the runs, close to all
constexpr std::uint64_t kGroups = 20;     // of the jackknife: their scatter is known to a sixth
constexpr std::uint32_t kDealing = 40;    // stream of random numbers

struct Choice {
  ChaosBasis basis = ChaosBasis::kLegendre;
  int degree = 0;
  std::vector<ChaosTerm> terms;
  Pursuit pursuit;
};

// Candidates of a degree, with fewer interactions where they are too many.
std::vector<ChaosTerm> Candidates(int d, int degree, const ChaosOptions& options, Eigen::Index n) {
  const auto most =
      std::min(kMostTerms, static_cast<std::size_t>(kMostNumbers / static_cast<double>(n)));
  for (int interaction = std::min(options.most_interaction, d); interaction > 0; --interaction) {
    auto terms = TermsOf(d, degree, options.truncation, interaction, most);
    if (!terms.empty()) return terms;
  }
  return {};
}

std::vector<ChaosTerm> Picked(const std::vector<ChaosTerm>& terms, const std::vector<int>& picked) {
  std::vector<ChaosTerm> some;
  some.reserve(picked.size());
  for (int i : picked) some.push_back(terms[static_cast<std::size_t>(i)]);
  return some;
}

// Degrees from 1 on, until two have brought nothing.
Choice Choose(ChaosBasis basis, const Eigen::MatrixXd& points, const Eigen::VectorXd& values,
              const ChaosOptions& options) {
  Choice best;
  best.pursuit.criterion = std::numeric_limits<double>::infinity();
  for (int degree = 1, worse = 0; degree <= options.most_degree && worse < 2; ++degree) {
    const auto terms = Candidates(static_cast<int>(points.rows()), degree, options, points.cols());
    if (terms.empty()) break;
    Pursuit pursuit = Pursue(TermValues(basis, terms, degree, points), values);
    if (pursuit.criterion < best.pursuit.criterion) {
      best = {basis, degree, Picked(terms, pursuit.picked), pursuit};
      worse = 0;
    } else {
      ++worse;
    }
  }
  return best;
}

Eigen::VectorXd LeastSquares(const Eigen::MatrixXd& columns, const Eigen::VectorXd& values) {
  return Eigen::HouseholderQR<Eigen::MatrixXd>(columns).solve(values);
}

// The group of each run, the same for all of a row.
std::vector<std::uint64_t> Deal(Eigen::Index n, const ChaosOptions& options, std::uint64_t groups) {
  const auto row = static_cast<std::uint64_t>(std::max(options.row, 1));
  const std::uint64_t rows = (static_cast<std::uint64_t>(n) + row - 1) / row;
  const KeyedPermutation order(rows, CounterRandom(options.seed, kDealing).Bits(groups, 0));
  std::vector<std::uint64_t> group;
  for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(n); ++i) {
    group.push_back(order(i / row) % groups);
  }
  return group;
}

// First and total shares of squared coefficients.
std::vector<ChaosIndex> SharesOf(const std::vector<ChaosTerm>& terms, const Eigen::VectorXd& c,
                                 std::size_t d) {
  std::vector<ChaosIndex> shares(d);
  double sum = 0.0;
  for (std::size_t t = 0; t < terms.size(); ++t) {
    const double square = c[static_cast<Eigen::Index>(t)] * c[static_cast<Eigen::Index>(t)];
    if (terms[t].empty()) continue;
    sum += square;
    if (terms[t].size() == 1) shares[static_cast<std::size_t>(terms[t][0].first)].first += square;
    for (const auto& [input, degree] : terms[t])
      shares[static_cast<std::size_t>(input)].total += square;
  }
  for (ChaosIndex& s : shares) {
    if (!(sum > 0.0)) break;
    s.first /= sum;
    s.total /= sum;
  }
  return shares;
}

}  // namespace

PolynomialChaos PolynomialChaos::Fit(const Eigen::MatrixXd& points, std::span<const double> values,
                                     const ChaosOptions& options) {
  if (static_cast<std::size_t>(points.cols()) != values.size() || points.rows() < 1) {
    throw Error(fmt::format("{} values of {} points of {} inputs", values.size(), points.cols(),
                            points.rows()),
                "", "give one value for each point");
  }
  if (points.size() > 0 && !(points.minCoeff() > 0.0 && points.maxCoeff() < 1.0)) {
    throw Error("points outside the unit cube", "", "give the inputs' probabilities, in (0, 1)");
  }
  PolynomialChaos chaos;
  std::vector<Eigen::Index> finite;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isfinite(values[i])) finite.push_back(static_cast<Eigen::Index>(i));
  }
  chaos.failed_ = values.size() - finite.size();
  // No more runs than leave room for as many terms as a straight line has.
  const auto most =
      static_cast<std::size_t>(kMostNumbers / (2.0 * static_cast<double>(points.rows() + 1)));
  if (finite.size() > most) finite.resize(most);
  chaos.runs_ = finite.size();
  chaos.indices_.resize(static_cast<std::size_t>(points.rows()));
  const Eigen::Index least = 2 * (points.rows() + 1);  // two runs a term of the simplest
  if (static_cast<Eigen::Index>(finite.size()) < std::max<Eigen::Index>(least, 4 * kFolds)) {
    chaos.notes_.push_back(fmt::format("{} with a value; {} are the least for {}",
                                       Counted(finite.size(), "run"),
                                       std::max<Eigen::Index>(least, 4 * kFolds),
                                       Counted(static_cast<std::size_t>(points.rows()), "input")));
    return chaos;
  }
  const Eigen::MatrixXd used = points(Eigen::all, finite);
  const Eigen::Map<const Eigen::VectorXd> all(values.data(),
                                              static_cast<Eigen::Index>(values.size()));
  Eigen::VectorXd y = all(finite);
  if (!(y.maxCoeff() > y.minCoeff())) {
    chaos.notes_.emplace_back("the response does not vary");
    return chaos;
  }
  // In units of its largest value, so that fourth powers stay numbers.
  const double scale = y.cwiseAbs().maxCoeff();
  y /= scale;
  Choice choice = Choose(ChaosBasis::kLegendre, used, y, options);
  Choice other = Choose(ChaosBasis::kHermite, used, y, options);
  if (other.pursuit.criterion < choice.pursuit.criterion) choice = std::move(other);
  chaos.basis_ = choice.basis;
  chaos.degree_ = choice.degree;
  chaos.terms_ = std::move(choice.terms);
  const Eigen::VectorXd off = y.array() - y.mean();
  chaos.q2_loo_ =
      1.0 - choice.pursuit.loo_error * static_cast<double>(y.size()) / off.squaredNorm();
  chaos.Validate(used, y, options);
  chaos.AddIndices(used, y, options);
  chaos.coefficients_ *= scale;
  chaos.mean_ *= scale;
  chaos.variance_ *= scale * scale;
  chaos.Judge(options);
  chaos.JudgeLevels(used, options);
  return chaos;
}

double PolynomialChaos::Predict(std::span<const double> u) const {
  if (u.size() != indices_.size()) {
    throw Error(
        fmt::format("a point of {} inputs for a surrogate of {}", u.size(), indices_.size()), "",
        "give one number for each");
  }
  if (terms_.empty()) return std::nan("");
  const Eigen::Map<const Eigen::VectorXd> point(u.data(), static_cast<Eigen::Index>(u.size()));
  return TermValues(basis_, terms_, degree_, point).row(0).dot(coefficients_);
}

// Five folds, each predicted by terms that are chosen, at the degree found, without it.
void PolynomialChaos::Validate(const Eigen::MatrixXd& points, const Eigen::VectorXd& values,
                               const ChaosOptions& options) {
  const Eigen::Index n = points.cols();
  const auto terms = Candidates(static_cast<int>(points.rows()), degree_, options, n);
  const Eigen::MatrixXd columns = TermValues(basis_, terms, degree_, points);
  const std::vector<std::uint64_t> fold = Deal(n, options, kFolds);
  Eigen::VectorXd square = Eigen::VectorXd::Zero(n);
  for (std::uint64_t k = 0; k < kFolds; ++k) {
    std::vector<Eigen::Index> in, out;
    for (Eigen::Index i = 0; i < n; ++i)
      (fold[static_cast<std::size_t>(i)] == k ? out : in).push_back(i);
    if (in.empty() || out.empty()) continue;
    const Eigen::MatrixXd kept = columns(in, Eigen::all);
    const Pursuit pursuit = Pursue(kept, values(in));
    const Eigen::MatrixXd chosen = kept(Eigen::all, pursuit.picked);
    const Eigen::VectorXd c = LeastSquares(chosen, values(in));
    const Eigen::MatrixXd held = columns(out, pursuit.picked);
    const Eigen::VectorXd error = values(out) - held * c;
    for (std::size_t i = 0; i < out.size(); ++i) {
      square[out[i]] = std::pow(error[static_cast<Eigen::Index>(i)], 2.0);
    }
  }
  const Eigen::VectorXd off = (values.array() - values.mean()).square();
  const double variance = off.mean(), left = square.mean() / variance;
  q2_ = 1.0 - left;
  // Standard error of a ratio of means [Cochran 1977, eq. (6.4)].
  const double error = std::sqrt((square - left * off).squaredNorm() / static_cast<double>(n)) /
                       variance / std::sqrt(n);
  q2_lower_ = q2_ - NormalQuantile(options.confidence) * error;
}

// Coefficients of all runs; errors of the shares by leaving out groups of runs in turn.
void PolynomialChaos::AddIndices(const Eigen::MatrixXd& points, const Eigen::VectorXd& values,
                                 const ChaosOptions& options) {
  const Eigen::MatrixXd columns = TermValues(basis_, terms_, degree_, points);
  coefficients_ = LeastSquares(columns, values);
  for (std::size_t t = 0; t < terms_.size(); ++t) {
    const double c = coefficients_[static_cast<Eigen::Index>(t)];
    if (terms_[t].empty()) {
      mean_ = c;
    } else {
      variance_ += c * c;
    }
  }
  const std::size_t d = indices_.size();
  indices_ = SharesOf(terms_, coefficients_, d);
  const Eigen::MatrixXd normal = columns.transpose() * columns;
  const Eigen::VectorXd right = columns.transpose() * values;
  const std::vector<std::uint64_t> group = Deal(points.cols(), options, kGroups);
  std::vector<std::vector<double>> first(d), total(d);
  for (std::uint64_t g = 0; g < kGroups; ++g) {
    std::vector<Eigen::Index> own;
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      if (group[static_cast<std::size_t>(i)] == g) own.push_back(i);
    }
    const Eigen::MatrixXd part = columns(own, Eigen::all);
    const Eigen::LDLT<Eigen::MatrixXd> without((normal - part.transpose() * part).eval());
    const Eigen::VectorXd c = without.solve(right - part.transpose() * values(own));
    const auto shares = SharesOf(terms_, c, d);
    for (std::size_t k = 0; k < d; ++k) {
      first[k].push_back(shares[k].first);
      total[k].push_back(shares[k].total);
    }
  }
  // [Efron and Tibshirani 1993, eq. (11.5)]; and what the surrogate leaves unexplained may be of
  // any input.
  const double groups = static_cast<double>(kGroups), left = std::clamp(1.0 - q2_, 0.0, 1.0);
  const auto error = [&](const std::vector<double>& x) {
    return std::hypot((groups - 1.0) / std::sqrt(groups) * std::sqrt(Variance(x)), left);
  };
  for (std::size_t k = 0; k < d; ++k) {
    indices_[k].first_error = error(first[k]);
    indices_[k].total_error = error(total[k]);
  }
}

void PolynomialChaos::JudgeLevels(const Eigen::MatrixXd& points, const ChaosOptions& options) {
  for (Eigen::Index k = 0; k < points.rows(); ++k) {
    std::vector<double> values(static_cast<std::size_t>(points.cols()));
    for (Eigen::Index i = 0; i < points.cols(); ++i)
      values[static_cast<std::size_t>(i)] = points(k, i);
    std::sort(values.begin(), values.end());
    const auto distinct = std::unique(values.begin(), values.end()) - values.begin();
    if (distinct > options.most_degree) continue;
    usable_ = false;
    notes_.push_back(
        fmt::format("not usable: the design has {} values of input {}, and nothing tells "
                    "what the response does between them; take a random, Latin or Sobol "
                    "design",
                    distinct, k + 1));
    return;
  }
}

void PolynomialChaos::Judge(const ChaosOptions& options) {
  usable_ = q2_lower_ >= options.least_q2;
  if (failed_ > 0) {
    notes_.push_back(fmt::format("{} failed: the surrogate does not know where runs fail",
                                 Counted(failed_, "run")));
  }
  if (usable_) return;
  notes_.push_back(
      fmt::format("not usable: it explains {:.3g} of the variance of runs that it has "
                  "not seen, {:.3g} at the least, where {:.3g} is asked for; more "
                  "runs, or a response that is no smooth function",
                  q2_, q2_lower_, options.least_q2));
}

}  // namespace unfurl::campaign
