// What readings show of their own noise and resolution.
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/statistics.h"
#include "correlate/residual/channel.h"

namespace unfurl::correlate {

double NoiseOf(const Eigen::VectorXd& y) {
  const Eigen::Index n = y.size();
  constexpr double kSquares = 20.0;  // 1 + 9 + 9 + 1: weights of a third difference
  std::vector<double> third;
  for (Eigen::Index i = 3; i < n; ++i) {
    third.push_back(y(i) - 3.0 * y(i - 1) + 3.0 * y(i - 2) - y(i - 3));
  }
  double noise = third.empty() ? 0.0 : RobustSigma(third) / std::sqrt(kSquares);
  // A quantum's readings are its own: uniform over its width.
  double quantum = std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 1; i < n; ++i) {
    const double step = std::abs(y(i) - y(i - 1));
    if (step > 0.0) quantum = std::min(quantum, step);
  }
  if (noise == 0.0 && std::isfinite(quantum)) noise = quantum / std::sqrt(12.0);
  return noise;
}

double ResolutionOf(const Eigen::VectorXd& y) {
  constexpr double kEach = 4.0;     // readings to a value: noise on a fine lattice takes each once
  constexpr double kWritten = 0.1;  // of a step, that values are off by as written
  std::vector<double> values(y.begin(), y.end());
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  const std::size_t n = values.size();
  if (n < 3 || static_cast<double>(y.size()) < kEach * static_cast<double>(n)) return 0.0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < n; ++i) least = std::min(least, values[i] - values[i - 1]);
  double steps = 0.0;
  for (std::size_t i = 1; i < n; ++i) steps += std::round((values[i] - values[i - 1]) / least);
  const double step = (values.back() - values.front()) / steps;
  for (const double v : values) {
    const double at = (v - values.front()) / step;
    if (std::abs(at - std::round(at)) > kWritten) return 0.0;
  }
  return step;
}

}  // namespace unfurl::correlate
