#include "correlate/compare/signal_metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/error.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

std::vector<double> IntegralWeights(std::span<const double> t) {
  std::vector<double> w(t.size(), 0.0);
  const double widest = SampledModel::kMaxGap * MedianStep(t);
  for (std::size_t i = 0; i + 1 < t.size(); ++i) {
    const double step = t[i + 1] - t[i];
    if (step > widest) continue;
    w[i] += 0.5 * step;
    w[i + 1] += 0.5 * step;
  }
  return w;
}

SignalScore ScoreSignals(std::span<const SignalPair> components) {
  SignalScore out;
  if (components.empty()) throw Error("no signals", "metrics", "give at least one");
  out.samples = components.front().t.size();
  const auto n = static_cast<double>(out.samples);
  double squares = 0.0, motion = 0.0, whitened = 0.0;
  double mm = 0.0, cc = 0.0, mc = 0.0, range2 = 0.0;
  bool has_sigma = true;
  std::vector<double> distance2(out.samples, 0.0);
  for (const SignalPair& p : components) {
    if (p.t.size() != out.samples || p.test.size() != out.samples ||
        p.computed.size() != out.samples || out.samples < 2) {
      throw Error("signals of different lengths, or of fewer than two samples", "metrics",
                  "give as many values as stamps, for every component alike");
    }
    has_sigma = has_sigma && p.sigma.size() == out.samples;
    const std::vector<double> w = IntegralWeights(p.t);
    double mean = 0.0;
    for (const double m : p.test) mean += m / n;
    for (std::size_t i = 0; i < out.samples; ++i) {
      const double m = p.test[i], c = p.computed[i], e = m - c;
      distance2[i] += e * e;
      squares += e * e;
      motion += (m - mean) * (m - mean);
      if (has_sigma) whitened += e * e / (p.sigma[i] * p.sigma[i]);
      mm += w[i] * m * m;
      cc += w[i] * c * c;
      mc += w[i] * m * c;
    }
    const auto [low, high] = std::minmax_element(p.test.begin(), p.test.end());
    range2 += (*high - *low) * (*high - *low);
  }
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  out.rmse = std::sqrt(squares / n);
  out.range = std::sqrt(range2);
  out.nrmse = out.range > 0.0 ? out.rmse / out.range : kNaN;
  out.r2 = motion > 0.0 ? 1.0 - squares / motion : kNaN;
  const auto worst = std::max_element(distance2.begin(), distance2.end());
  out.largest = std::sqrt(*worst);
  out.largest_at = components.front().t[static_cast<std::size_t>(worst - distance2.begin())];
  if (has_sigma) {
    out.sigmas = std::sqrt(whitened / (n * static_cast<double>(components.size())));
  }
  // Where one of the two does not move there is no ratio and no angle.
  const double both = std::sqrt(mm) * std::sqrt(cc);
  const double phase =
      both > 0.0 ? std::acos(std::clamp(mc / both, -1.0, 1.0)) / std::numbers::pi : kNaN;
  out.sprague_geers_magnitude = mm > 0.0 ? std::sqrt(cc / mm) - 1.0 : kNaN;
  out.sprague_geers_phase = phase;
  out.sprague_geers = std::hypot(out.sprague_geers_magnitude, phase);
  const double r = both > 0.0 ? (cc - mm) / both : kNaN;
  out.russell_magnitude = std::copysign(std::log10(1.0 + std::abs(r)), r);
  out.russell_phase = phase;
  out.russell = std::sqrt(0.25 * std::numbers::pi) * std::hypot(out.russell_magnitude, phase);
  return out;
}

}  // namespace unfurl::correlate
