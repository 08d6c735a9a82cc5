#include "correlate/hierarchy/normal_mixture.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/probability.h"
#include "base/statistics.h"

namespace unfurl::correlate {

double NormalMixture::Cdf(double x) const {
  double sum = 0.0;
  for (Eigen::Index k = 0; k < weight.size(); ++k) {
    sum += weight(k) * NormalCdf((x - mean(k)) / std::sqrt(variance(k)));
  }
  return sum;
}

double NormalMixture::LogDensity(double x) const {
  // The largest exponent comes out, so that the sum does not underflow far from the mean.
  double largest = -std::numeric_limits<double>::infinity();
  const auto exponent = [&](Eigen::Index k) {
    const double d = x - mean(k);
    return std::log(weight(k)) - 0.5 * d * d / variance(k) -
           0.5 * std::log(2.0 * std::numbers::pi * variance(k));
  };
  for (Eigen::Index k = 0; k < weight.size(); ++k) largest = std::max(largest, exponent(k));
  double sum = 0.0;
  for (Eigen::Index k = 0; k < weight.size(); ++k) sum += std::exp(exponent(k) - largest);
  return largest + std::log(sum);
}

double NormalMixture::Mean() const { return weight.dot(mean); }

double NormalMixture::Quantile(double p) const {
  // Between the least and the largest of the components' own quantiles; Newton's steps on the
  // distribution, halving where they leave the bracket.
  const double z = NormalQuantile(p);
  const Eigen::ArrayXd own = mean.array() + z * variance.array().sqrt();
  double low = own.minCoeff(), high = own.maxCoeff();
  double x = 0.5 * (low + high);
  constexpr double kClose = 1e-10;  // of the bracket that is left, to the components' spread [-]
  const double close = kClose * (std::abs(low) + std::abs(high) + std::sqrt(variance.maxCoeff()));
  constexpr int kMost = 200;  // halvings alone need 60
  for (int i = 0; i < kMost && high - low > close; ++i) {
    const double miss = Cdf(x) - p;
    (miss > 0.0 ? high : low) = x;
    const double next = x - miss / std::exp(LogDensity(x));
    const bool inside = next > low && next < high;
    const double step = std::abs(next - x);
    x = inside ? next : 0.5 * (low + high);
    if (inside && step < close) break;
  }
  return x;
}

Interval NormalMixture::Middle95() const {
  constexpr double kTail = 0.025;  // on each side of 95%
  return {Quantile(kTail), Quantile(1.0 - kTail)};
}

double NormalMixture::Sigma() const {
  const Interval middle = Middle95();
  return 0.5 * (middle.high - middle.low) / kHalf95;
}

}  // namespace unfurl::correlate
