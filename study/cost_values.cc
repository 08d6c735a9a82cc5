#include "study/cost_values.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace unfurl::study {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double RangeOf(const std::vector<double>& v) {
  if (v.empty()) return 0.0;
  const auto [least, most] = std::minmax_element(v.begin(), v.end());
  return *most - *least;
}

// The value at `t` from the samples within [low, high) alone, else the nearest one [s].
double Within(const std::vector<double>& v, double step, double t, double low, double high) {
  const double last = static_cast<double>(v.size()) - 1.0;
  const double first_k = std::clamp(std::ceil(low / step), 0.0, last);
  const double last_k = std::clamp(std::ceil(high / step) - 1.0, 0.0, last);
  if (last_k < first_k) return v[static_cast<std::size_t>(std::clamp(t / step + 0.5, 0.0, last))];
  const double at = std::clamp(t / step, first_k, last_k);
  const double below = std::min(std::floor(at), std::max(first_k, last_k - 1.0));
  const auto k = static_cast<std::size_t>(below);
  if (last_k == first_k) return v[k];
  return v[k] + (at - below) * (v[k + 1] - v[k]);
}

}  // namespace

CostDistance DistanceOf(const CostValues& p, const CostValues& q) {
  const std::size_t n = std::min(p.a.size(), q.a.size());
  if (n == 0) return {kInfinity, kInfinity};
  CostDistance out;
  double sum = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const double dy = p.b.empty() ? 0.0 : p.b[i] - q.b[i];
    const double d = std::hypot(p.a[i] - q.a[i], dy);
    sum += d * d;
    out.largest = std::max(out.largest, d);
  }
  out.rms = std::sqrt(sum / static_cast<double>(n));
  return out;
}

double ScaleOf(const CostQuantity& quantity, const CostValues& values) {
  using Kind = CostQuantity::Kind;
  if (values.a.empty()) return 0.0;
  if (quantity.kind == Kind::kNumber || quantity.kind == Kind::kFrequency) {
    return std::fabs(values.a[0]);
  }
  return std::hypot(RangeOf(values.a), RangeOf(values.b));
}

std::vector<double> FromEventToEvent(const std::vector<double>& series, double step,
                                     const CostEvents& own, const CostEvents& others) {
  if (series.empty()) return series;
  // Pairs in which time goes on in both.
  std::vector<std::pair<double, double>> knots = {{0.0, 0.0}};  // others', own [s]
  for (const auto& [name, t] : others) {
    const auto same = std::find_if(own.begin(), own.end(),
                                   [&, n = &name](const auto& e) { return e.first == *n; });
    if (same == own.end() || same->second <= knots.back().second || t <= knots.back().first) {
      continue;
    }
    knots.emplace_back(t, same->second);
  }
  const double end = step * static_cast<double>(series.size() - 1);
  // After the last event both clocks run alike.
  const double rest = end - knots.back().first;
  knots.emplace_back(end, knots.back().second + rest + step);  // the last sample is within
  knots.back().first += step;
  std::vector<double> out(series.size());
  std::size_t k = 0;
  for (std::size_t i = 0; i < series.size(); ++i) {
    const double t = step * static_cast<double>(i);
    while (k + 2 < knots.size() && t >= knots[k + 1].first) ++k;
    const auto& [a0, b0] = knots[k];
    const auto& [a1, b1] = knots[k + 1];
    const double at = a1 > a0 ? b0 + (t - a0) * (b1 - b0) / (a1 - a0) : b0;
    out[i] = Within(series, step, at, b0, b1);
  }
  return out;
}

}  // namespace unfurl::study
