#include "measure/spot_bound.h"

#include <cmath>
#include <numbers>

#include "base/dense.h"

namespace unfurl::measure {

double CentreBound(double centre, double width, double flux, const PixelNoise& noise) {
  constexpr double kReach = 7.0;  // widths: 2e-12 of the light lies beyond
  constexpr int kBackground = 8;  // pixels without light at either end
  const int first = static_cast<int>(std::floor(centre - kReach * width)) - kBackground;
  const int last = static_cast<int>(std::ceil(centre + kReach * width)) + kBackground;
  const auto cdf = [](double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); };
  const auto pdf = [](double z) {
    return std::exp(-0.5 * z * z) * std::numbers::inv_sqrtpi / std::numbers::sqrt2;
  };
  Eigen::Matrix4d fisher = Eigen::Matrix4d::Zero();
  for (int k = first; k <= last; ++k) {
    const double low = (k - 0.5 - centre) / width, high = (k + 0.5 - centre) / width;
    const double share = cdf(high) - cdf(low);
    const Eigen::Vector4d slope(-flux * (pdf(high) - pdf(low)) / width,
                                -flux * (high * pdf(high) - low * pdf(low)) / width, share, 1.0);
    const double variance = noise.dark_variance + flux * share / noise.electrons_per_count;
    fisher += slope * slope.transpose() / variance;
  }
  return std::sqrt(fisher.llt().solve(Eigen::Vector4d::UnitX())(0));
}

}  // namespace unfurl::measure
