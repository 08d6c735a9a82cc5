#include "correlate/fit/interval.h"

#include <cmath>

#include "correlate/fit/fit.h"

namespace unfurl::correlate {

namespace {

// The standard error of u that belongs to one of the value.
double Internal(const Parameter& parameter, const ParameterEstimate& e, double sigma) {
  return sigma / std::abs(Slope(parameter, e.value));
}

double Normal(double z) { return 0.5 * std::erfc(-z / std::sqrt(2.0)); }

// How many standard errors beyond either end of a range a 95% interval of a value reaches that lies
// anywhere in it: Phi(c + range) - Phi(-c) = 0.95 with the range in standard errors [Imbens and
// Manski 2004, Econometrica 72, 1845-1857]. 1.96 for no range, 1.645 for a wide one.
double Reach(double range) {
  double low = 1.6, high = kHalf95;
  constexpr int kHalvings = 50;  // of an interval of width 0.4: down to a double's last digits
  for (int i = 0; i < kHalvings; ++i) {
    const double c = 0.5 * (low + high);
    (Normal(c + range) - Normal(-c) < 0.95 ? low : high) = c;
  }
  return high;
}

}  // namespace

Interval IntervalOfData(const Parameter& parameter, const ParameterEstimate& e) {
  if (!e.profile.points.empty()) return {e.profile.low, e.profile.high};
  const double u = ToInternal(parameter, e.value);
  const double half = kHalf95 * Internal(parameter, e, e.sigma_data);
  return {FromInternal(parameter, StepAsymptotic(parameter, u, -half)),
          FromInternal(parameter, StepAsymptotic(parameter, u, half))};
}

Interval IntervalOfAllParts(const Parameter& parameter, const ParameterEstimate& e,
                            bool one_sided) {
  const Interval data = IntervalOfData(parameter, e);
  const double u = ToInternal(parameter, e.value);
  const double model = kHalf95 * Internal(parameter, e, one_sided ? e.sigma_doubt : e.sigma_model);
  auto step_to = [&](double value) {
    return AsymptoticStep(parameter, u, ToInternal(parameter, value));
  };
  const double below = std::hypot(step_to(data.low), model);
  const double above = std::hypot(step_to(data.high), model);
  // What the finest rung leaves has a direction: the value may lie anywhere on that way.
  const double way = one_sided ? e.model_shift / Slope(parameter, e.value) : 0.0;
  const double half = std::fmax(below, above);  // the other one where a side is open
  const double part = half > 0.0 ? Reach(std::abs(way) * kHalf95 / half) / kHalf95 : 1.0;
  Interval out;
  if (data.low == data.low) {
    const double step = std::min(0.0, way) - part * below;
    out.low = FromInternal(parameter, StepAsymptotic(parameter, u, step));
  }
  if (data.high == data.high) {
    const double step = std::max(0.0, way) + part * above;
    out.high = FromInternal(parameter, StepAsymptotic(parameter, u, step));
  }
  return out;
}

}  // namespace unfurl::correlate
