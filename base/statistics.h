#pragma once

#include <cstddef>
#include <span>
#include <utility>

namespace unfurl {

// Quantiles: x with P(X <= x) = p, 0 < p < 1. From Boost.Math.
double ChiSquareQuantile(double p, double degrees_of_freedom);
double NormalQuantile(double p);
double StudentQuantile(double p, double degrees_of_freedom);
// Of the ratio of two mean squares (Fisher), over and under the line.
double FisherQuantile(double p, double over, double under);
// P(X > x) of a chi-square variable: the p-value of a sum of squared whitened residuals.
double ChiSquareTail(double x, double degrees_of_freedom);

// Of several tests that are independent of each other [Sidak], 0 <= p, level < 1: the chance that
// at least one of them gives a p-value as small as p; and what each of them may be tested at, so
// that the chance of any false alarm is `level` (of fewer than one: of one).
double ChanceOfAny(double p, double tests);
double ChanceOfEach(double level, double tests);

// Clopper-Pearson interval of a proportion from `successes` out of `trials`.
std::pair<double, double> BinomialInterval(std::size_t successes, std::size_t trials,
                                           double confidence = 0.95);

double Mean(std::span<const double> x);
double Variance(std::span<const double> x);  // with n - 1; 0 for fewer than two values
double Rms(std::span<const double> x);
double Median(std::span<const double> x);              // copies
double Quantile(std::span<const double> x, double p);  // linear between order statistics; copies
double RobustSigma(std::span<const double> x);         // 1.4826 times the median absolute deviation

}  // namespace unfurl
