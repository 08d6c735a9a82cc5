// What readings show of their own noise and resolution.
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/statistics.h"
#include "correlate/residual/channel.h"

namespace unfurl::correlate {

namespace {
constexpr double kSquares = 20.0;  // 1 + 9 + 9 + 1: weights of a third difference
}  // namespace

double NoiseOf(const Eigen::VectorXd& y) {
  const Eigen::Index n = y.size();
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

namespace {

// Whether readings have met an end: the one that lies highest of `values`.
bool IsMet(const std::vector<double>& values, double noise, double step) {
  // By chance as many lie there in one record of a million, were they as dense as within a standard
  // deviation of their noise of it. With less noise than a step a motion that rests takes one value
  // again and again.
  constexpr double kUnlikely = 1e-6;
  if (!(noise > step)) return false;
  const double end = *std::max_element(values.begin(), values.end());
  int at_end = 0;
  double near = 1.0;
  for (const double v : values) {
    at_end += v == end ? 1 : 0;
    near += v < end && v > end - noise ? 1.0 : 0.0;
  }
  const double expected = near * step / noise;
  double term = std::exp(-expected), below = 0.0;  // Poisson
  for (int k = 0; k < at_end; ++k) below += term, term *= expected / (1.0 + k);
  return 1.0 - below < kUnlikely;
}

}  // namespace

Range RangeOf(const Eigen::VectorXd& y) {
  Range out;
  const Eigen::Index n = y.size();
  if (n == 0) return out;
  const double low = y.minCoeff(), high = y.maxCoeff();
  // Noise and resolution by what lies between the ends.
  auto inside = [&](Eigen::Index i) { return y(i) > low && y(i) < high; };
  std::vector<double> third, values(y.begin(), y.end());
  double step = std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 3; i < n; ++i) {
    const double by = std::abs(y(i) - y(i - 1));
    if (by > 0.0) step = std::min(step, by);
    if (!inside(i) || !inside(i - 1) || !inside(i - 2) || !inside(i - 3)) continue;
    third.push_back(y(i) - 3.0 * y(i - 1) + 3.0 * y(i - 2) - y(i - 3));
  }
  if (third.empty()) return out;
  const double noise = RobustSigma(third) / std::sqrt(kSquares);
  if (IsMet(values, noise, step)) out.high = high;
  for (double& v : values) v = -v;
  if (IsMet(values, noise, step)) out.low = low;
  return out;
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
