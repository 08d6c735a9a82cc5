#include "base/statistics.h"

#include <algorithm>
#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <vector>

namespace unfurl {

namespace bm = boost::math;

double ChiSquareQuantile(double p, double degrees_of_freedom) {
  return bm::quantile(bm::chi_squared(degrees_of_freedom), p);
}

double NormalQuantile(double p) { return bm::quantile(bm::normal(), p); }

double StudentQuantile(double p, double degrees_of_freedom) {
  return bm::quantile(bm::students_t(degrees_of_freedom), p);
}

double FisherQuantile(double p, double over, double under) {
  return bm::quantile(bm::fisher_f(over, under), p);
}

double ChiSquareTail(double x, double degrees_of_freedom) {
  if (std::isinf(x) && x > 0.0) return 0.0;  // boost knows no limit
  return bm::cdf(bm::complement(bm::chi_squared(degrees_of_freedom), x));
}

// Both by way of ln(1 - p), which small chances need.
double ChanceOfAny(double p, double tests) { return -std::expm1(tests * std::log1p(-p)); }

double ChanceOfEach(double level, double tests) {
  return -std::expm1(std::log1p(-level) / std::max(1.0, tests));
}

std::pair<double, double> BinomialInterval(std::size_t successes, std::size_t trials,
                                           double confidence) {
  using Binomial = bm::binomial_distribution<double>;
  const double alpha = (1.0 - confidence) / 2.0;
  const double n = static_cast<double>(trials);
  const double k = static_cast<double>(successes);
  const double low = successes == 0 ? 0.0 : Binomial::find_lower_bound_on_p(n, k, alpha);
  const double high = successes == trials ? 1.0 : Binomial::find_upper_bound_on_p(n, k, alpha);
  return {low, high};
}

double Mean(std::span<const double> x) {
  double sum = 0.0;
  for (double v : x) sum += v;
  return x.empty() ? 0.0 : sum / static_cast<double>(x.size());
}

double Variance(std::span<const double> x) {
  if (x.size() < 2) return 0.0;
  const double mean = Mean(x);
  double sum = 0.0;
  for (double v : x) sum += (v - mean) * (v - mean);
  return sum / static_cast<double>(x.size() - 1);
}

double Rms(std::span<const double> x) {
  double sum = 0.0;
  for (double v : x) sum += v * v;
  return x.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(x.size()));
}

double Quantile(std::span<const double> x, double p) {
  if (x.empty()) return std::nan("");
  std::vector<double> parted(x.begin(), x.end());
  const double at = std::clamp(p, 0.0, 1.0) * static_cast<double>(parted.size() - 1);
  const auto below = parted.begin() + static_cast<std::ptrdiff_t>(at);
  std::nth_element(parted.begin(), below, parted.end());
  if (below + 1 == parted.end()) return *below;
  const double above = *std::min_element(below + 1, parted.end());
  return *below + (at - std::floor(at)) * (above - *below);
}

double Median(std::span<const double> x) { return Quantile(x, 0.5); }

double RobustSigma(std::span<const double> x) {
  const double median = Median(x);
  std::vector<double> deviation(x.begin(), x.end());
  for (double& v : deviation) v = std::abs(v - median);
  return 1.482602218505602 * Median(deviation);
}

}  // namespace unfurl
