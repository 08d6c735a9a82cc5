#include "campaign/statistics/intervals.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/probability.h"
#include "base/statistics.h"

namespace unfurl::campaign {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Mean of ((x - center) / unit)^k, k of 3 or 4: in units of the scatter it stays a number.
double Moment(std::span<const double> x, double center, double unit, int k) {
  double sum = 0.0;
  for (double v : x) {
    const double d = (v - center) / unit;
    sum += k == 3 ? d * d * d : d * d * d * d;
  }
  return sum / static_cast<double>(x.size());
}

// Mean of what is left when the share `trim` is taken off each end.
double TrimmedMean(std::span<const double> x, double trim) {
  std::vector<double> sorted(x.begin(), x.end());
  std::sort(sorted.begin(), sorted.end());
  const auto off = static_cast<std::size_t>(trim * static_cast<double>(x.size()));
  return Mean(std::span<const double>(sorted).subspan(off, sorted.size() - 2 * off));
}

// Least n in (low, high] with holds(n), which is monotone and true at high.
template <typename F>
std::size_t Bisect(std::size_t low, std::size_t high, const F& holds) {
  while (high - low > 1) {
    const std::size_t middle = low + (high - low) / 2;
    (holds(middle) ? high : low) = middle;
  }
  return high;
}

// Confidence that n runs without `off` outermost values enclose the content: of the order
// statistics between which n + 1 - off gaps lie, P(Bin(n, content) <= n - off).
double WilksConfidence(std::size_t n, double content, std::size_t off) {
  return off > n ? 0.0 : BinomialCdf(n - off, n, content);
}

std::size_t Outermost(int sides, std::size_t left_out) {
  return static_cast<std::size_t>(sides) * (left_out + 1);
}

}  // namespace

Interval MeanInterval(std::span<const double> x, double confidence) {
  if (x.size() < 2) return {-kInfinity, kInfinity};
  const double n = static_cast<double>(x.size());
  const double mean = Mean(x), error = std::sqrt(Variance(x) / n);
  if (!(error > 0.0)) return {mean, mean};
  const double deviation = error * std::sqrt(n - 1.0);  // the standard deviation with n
  const double skewness = Moment(x, mean, deviation, 3);
  const double a = skewness / std::sqrt(n);
  // Hall's transformation of Student's t has a cubic as its inverse's graph; [Hall 1992, eq. (3.6)]
  const auto inverse = [a](double t) {
    constexpr double kSymmetric = 1e-6;  // the series' next term is of this order
    const double s = t - a / 6.0;
    return std::abs(a) < kSymmetric ? s : 3.0 / a * (std::cbrt(1.0 + a * s) - 1.0);
  };
  const double t = StudentQuantile(0.5 + confidence / 2.0, n - 1.0);
  return {mean - error * inverse(t), mean - error * inverse(-t)};
}

Interval SigmaInterval(std::span<const double> x, double confidence) {
  constexpr std::size_t kLeast = 5;  // the trimming share 1 / (2 sqrt(n - 4)) needs as many
  if (x.size() < kLeast) return {0.0, kInfinity};
  const double n = static_cast<double>(x.size());
  const double sigma = std::sqrt(Variance(x));
  if (!(sigma > 0.0)) return {0.0, 0.0};
  const double z = NormalQuantile(0.5 + confidence / 2.0);
  // [Bonett 2006, eq. (5)]: the kurtosis about a trimmed mean, which skewness misleads less.
  const double trim = 1.0 / (2.0 * std::sqrt(n - 4.0));
  const double deviation = sigma * std::sqrt((n - 1.0) / n);  // with n
  const double kurtosis = Moment(x, TrimmedMean(x, std::min(trim, 0.49)), deviation, 4);
  const double c = n / (n - z);
  const double error =
      c * std::sqrt(std::max((kurtosis - (n - 3.0) / n) / (n - 1.0), 0.0));  // of log sigma^2
  const double middle = std::log(c) / 2.0 + std::log(sigma);
  return {std::exp(middle - z * error / 2.0), std::exp(middle + z * error / 2.0)};
}

std::optional<std::pair<std::size_t, std::size_t>> QuantileRanks(std::size_t n, double p,
                                                                 double confidence) {
  const double tail = (1.0 - confidence) / 2.0;
  // Of n values, K ~ Bin(n, p) lie below the quantile. Rank r is above it when K < r.
  if (n == 0 || BinomialCdf(0, n, p) > tail || BinomialCdf(n - 1, n, p) < 1.0 - tail) return {};
  const std::size_t above =
      Bisect(0, n, [&](std::size_t k) { return BinomialCdf(k, n, p) > tail; });
  const std::size_t high =
      Bisect(0, n, [&](std::size_t s) { return BinomialCdf(s - 1, n, p) >= 1.0 - tail; });
  return std::pair{above, high};
}

std::size_t WilksRuns(double content, double confidence, int sides, std::size_t left_out) {
  const std::size_t off = Outermost(sides, left_out);
  const auto holds = [&](std::size_t n) { return WilksConfidence(n, content, off) >= confidence; };
  std::size_t high = off;
  while (!holds(high)) high *= 2;
  return Bisect(0, high, holds);
}

std::optional<std::size_t> WilksLeftOut(std::size_t n, double content, double confidence,
                                        int sides) {
  const auto holds = [&](std::size_t m) {
    return WilksConfidence(n, content, Outermost(sides, m)) >= confidence;
  };
  if (!holds(0)) return {};
  return Bisect(0, n + 1, [&](std::size_t m) { return !holds(m); }) - 1;
}

double NormalToleranceFactor(std::size_t count, double content, double confidence) {
  const double n = static_cast<double>(count);
  const double z = NormalQuantile(0.5 + content / 2.0);
  const double chi_square = ChiSquareQuantile(1.0 - confidence, n - 1.0);
  return z * std::sqrt((n - 1.0) * (1.0 + 1.0 / n) / chi_square);
}

double DistributionBand(std::size_t n, double confidence) {
  if (n == 0) return 1.0;
  return std::min(1.0, std::sqrt(std::log(2.0 / (1.0 - confidence)) / (2.0 * n)));
}

double NormalityP(std::span<const double> sorted) {
  constexpr std::size_t kLeast = 8;  // the table's
  const double sigma = std::sqrt(Variance(sorted)), mean = Mean(sorted);
  if (sorted.size() < kLeast || !(sigma > 0.0)) return 0.0;
  const double n = static_cast<double>(sorted.size());
  double sum = 0.0;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    const double below = NormalCdf((sorted[i] - mean) / sigma);
    const double above = NormalCdf((mean - sorted[sorted.size() - 1 - i]) / sigma);
    constexpr double kLeastLog = 1e-300;  // a value that far out decides the test anyway
    sum += (2.0 * static_cast<double>(i) + 1.0) *
           (std::log(std::max(below, kLeastLog)) + std::log(std::max(above, kLeastLog)));
  }
  const double a = (-n - sum / n) * (1.0 + 0.75 / n + 2.25 / (n * n));
  if (a >= 10.0) return 0.0;  // the fit below turns up again far out
  if (a >= 0.6) return std::exp(1.2937 - 5.709 * a + 0.0186 * a * a);
  if (a >= 0.34) return std::exp(0.9177 - 4.279 * a - 1.38 * a * a);
  if (a >= 0.2) return 1.0 - std::exp(-8.318 + 42.796 * a - 59.938 * a * a);
  return 1.0 - std::exp(-13.436 + 101.14 * a - 223.73 * a * a);
}

}  // namespace unfurl::campaign
