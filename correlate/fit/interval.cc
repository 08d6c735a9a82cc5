#include "correlate/fit/interval.h"

#include <cmath>

#include "correlate/fit/fit.h"

namespace unfurl::correlate {

namespace {

// The standard error of u that belongs to one of the value.
double Internal(const Parameter& parameter, const ParameterEstimate& e, double sigma) {
  return sigma / std::abs(Slope(parameter, e.value));
}

}  // namespace

Interval IntervalOfData(const Parameter& parameter, const ParameterEstimate& e) {
  if (!e.profile.points.empty()) return {e.profile.low, e.profile.high};
  const double u = ToInternal(parameter, e.value);
  const double half = kHalf95 * Internal(parameter, e, e.sigma_data);
  return {FromInternal(parameter, u - half), FromInternal(parameter, u + half)};
}

Interval IntervalOfAllParts(const Parameter& parameter, const ParameterEstimate& e) {
  const Interval data = IntervalOfData(parameter, e);
  const double u = ToInternal(parameter, e.value);
  const double model = kHalf95 * Internal(parameter, e, e.sigma_model);
  Interval out;
  if (data.low == data.low) {
    out.low = FromInternal(parameter, u - std::hypot(u - ToInternal(parameter, data.low), model));
  }
  if (data.high == data.high) {
    out.high = FromInternal(parameter, u + std::hypot(ToInternal(parameter, data.high) - u, model));
  }
  return out;
}

}  // namespace unfurl::correlate
