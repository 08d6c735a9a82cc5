#pragma once

#include <memory>
#include <string>
#include <vector>

namespace unfurl::campaign {

/// The distribution of one number of a campaign's plan. An immutable value, cheap to copy.
///
/// Makers and Truncated throw Error on parameters that are none: not finite, a width that is not
/// above zero, bounds in the wrong order, weights that do not add up to anything.
class Distribution {
 public:
  /// sigma > 0.
  static Distribution Normal(double mean, double sigma);
  /// low < high.
  static Distribution Uniform(double low, double high);
  /// `factor` > 1: the logarithm's standard deviation is log(factor), so that 68% lie between
  /// median / factor and median * factor.
  static Distribution LogNormal(double median, double factor);
  static Distribution LogUniform(double low, double high);  // 0 < low < high
  static Distribution Triangular(double low, double mode, double high);
  /// Discrete: `values` with `weights` in proportion to their probabilities (empty: equal ones).
  static Distribution Table(std::vector<double> values, std::vector<double> weights = {});
  /// Of `samples`: the quantile is linear between order statistics, from the least at 0 to the
  /// largest at 1.
  static Distribution Empirical(std::vector<double> samples);

  /// Conditional on low <= x <= high; either may be infinite. An interval that holds less than
  /// 1e-300 of the probability is refused.
  Distribution Truncated(double low, double high) const;

  /// x with P(X <= x) = u. Throws Error outside [0, 1], and at 0 or 1 where that end is infinite.
  double Quantile(double u) const;
  /// P(X <= x).
  double Cdf(double x) const;
  double Mean() const;
  double Sigma() const;  // standard deviation

  /// "normal, mean 3, sigma 0.1"
  std::string Words() const;

  /// The continuous or discrete law itself.
  class Law;

 private:
  explicit Distribution(std::shared_ptr<const Law> law) : law_(std::move(law)) {}

  std::shared_ptr<const Law> law_;
};

}  // namespace unfurl::campaign
