#pragma once

#include <limits>

#include "correlate/fit/parameter.h"

namespace unfurl::correlate {

struct ParameterEstimate;

/// A 95% interval of one parameter, in its unit. NaN: open on that side, the data do not end it.
struct Interval {
  double low = std::numeric_limits<double>::quiet_NaN();   // [unit]
  double high = std::numeric_limits<double>::quiet_NaN();  // [unit]
  /// The data end it on both sides.
  bool Closed() const { return low == low && high == high; }
};

/// 97.5% quantile of the standard normal density: half of a 95% interval in standard errors.
inline constexpr double kHalf95 = 1.959963984540054;

/// The 95% interval that the data alone give: by profile where there is one (open where it does
/// not end), by the standard error `sigma_data` where none was asked for.
Interval IntervalOfData(const Parameter& parameter, const ParameterEstimate& estimate);

/// The 95% interval of all parts. Each half of the data's interval and the half that the model's
/// own error gives, 1.96 sigma_model, are independent and add in quadrature, by the value; a
/// logarithm's lower end stays positive (StepAsymptotic). They end at the bounds at the latest.
/// `one_sided`: of the model's error sigma_doubt lies to either side, and the rest anywhere between
/// none and model_shift, so that the interval reaches that way.
Interval IntervalOfAllParts(const Parameter& parameter, const ParameterEstimate& estimate,
                            bool one_sided = false);

}  // namespace unfurl::correlate
