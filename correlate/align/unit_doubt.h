#pragma once

#include <string>

#include "correlate/sampled_model.h"

namespace unfurl::correlate {

/// How a record's lengths and times compare with a reference's, whatever frame and offset; 1:
/// alike, 0: cannot be told [-].
struct UnitRatios {
  double length = 0.0;  ///< spread of the marks' samples about their mean
  double time = 0.0;    ///< that spread over the highest speed
  double duration = 0.0;
};
UnitRatios CompareUnits(const Observations& record, const Observations& reference);

/// In words, where the ratios are a power of a thousand to within a factor of ten: "its times are
/// about 1000 times the reference's: are they in milliseconds?". No such doubt of times where the
/// durations are alike: a reference that hardly moves is slow in any unit. Empty: no doubt.
std::string UnitDoubt(const UnitRatios& ratios);

}  // namespace unfurl::correlate
