#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "campaign/statistics/intervals.h"

namespace unfurl::campaign {

/// The polynomials of one input: of its probability u, or of its normal score.
enum class ChaosBasis { kLegendre, kHermite };

/// How a chaos is fitted and judged.
struct ChaosOptions {
  int most_degree = 12;
  /// Total degree in the norm (sum of degree^q)^(1/q) that a term may have at most, q in (0, 1]:
  /// the smaller, the fewer interactions of high degree [Blatman and Sudret 2011].
  double truncation = 0.75;
  int most_interaction = 3;  // inputs in one term
  /// Cross-validated share of the variance that must be explained, at its lower bound: what is
  /// not explained bounds the error of every index.
  double least_q2 = 0.8;
  double confidence = 0.95;
  std::uint64_t seed = 1;
  int row = 1;  // consecutive runs that depend on each other (Design::row) stay in one fold
};

/// Shares of the surrogate's variance.
struct ChaosIndex {
  double first = 0.0, first_error = 0.0;
  double total = 0.0, total_error = 0.0;
};

/// One product of polynomials: input and degree of each factor; none is the constant.
using ChaosTerm = std::vector<std::pair<int, int>>;

/// A sparse polynomial chaos of independent inputs on the unit cube [Blatman and Sudret 2011]:
/// terms by orthogonal matching pursuit, their number, degree and basis by the least leave-one-out
/// error.
class PolynomialChaos {
 public:
  /// `points` of the unit cube, one a column, with their values, NaN where a run failed. Throws
  /// Error for points outside (0, 1) or counts that differ; a fit that is no good says so. So does
  /// one to a grid or trajectories: with no more values of an input than `most_degree`, folds do
  /// not see what the response does between them.
  static PolynomialChaos Fit(const Eigen::MatrixXd& points, std::span<const double> values,
                             const ChaosOptions& options = {});

  /// The response at a point of the unit cube; NaN where nothing was fitted. Error for a wrong
  /// size.
  double Predict(std::span<const double> u) const;

  std::size_t runs() const { return runs_; }      // that have a value and were used
  std::size_t failed() const { return failed_; }  // without one
  /// The polynomials chosen.
  ChaosBasis basis() const { return basis_; }
  /// The degree up to which terms were tried.
  int degree() const { return degree_; }
  /// The terms chosen.
  const std::vector<ChaosTerm>& terms() const { return terms_; }
  /// Of the terms, in the response's unit.
  const Eigen::VectorXd& coefficients() const { return coefficients_; }
  double mean() const { return mean_; }          // of the surrogate
  double variance() const { return variance_; }  // of the surrogate
  /// Explained share of the variance: leave-one-out (which knows the terms), and by five folds,
  /// each predicted by terms chosen without it; the latter with a lower bound.
  double q2_leave_one_out() const { return q2_loo_; }
  double q2() const { return q2_; }
  double q2_lower() const { return q2_lower_; }
  const std::vector<ChaosIndex>& indices() const { return indices_; }
  bool usable() const { return usable_; }
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  void Validate(const Eigen::MatrixXd& points, const Eigen::VectorXd& values,
                const ChaosOptions& options);
  void AddIndices(const Eigen::MatrixXd& points, const Eigen::VectorXd& values,
                  const ChaosOptions& options);
  void JudgeLevels(const Eigen::MatrixXd& points, const ChaosOptions& options);
  void Judge(const ChaosOptions& options);

  std::size_t runs_ = 0, failed_ = 0;
  ChaosBasis basis_ = ChaosBasis::kLegendre;
  int degree_ = 0;
  std::vector<ChaosTerm> terms_;
  Eigen::VectorXd coefficients_;
  double mean_ = 0.0, variance_ = 0.0, q2_loo_ = 0.0, q2_ = 0.0, q2_lower_ = 0.0;
  std::vector<ChaosIndex> indices_;
  bool usable_ = false;
  std::vector<std::string> notes_;
};

}  // namespace unfurl::campaign
