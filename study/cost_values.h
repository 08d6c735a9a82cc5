#pragma once

#include <string>
#include <utility>
#include <vector>

#include "study/cost_quantities.h"

namespace unfurl::study {

/// What a run gives of one quantity: samples in time, of a mark x and y; of a number one. Empty:
/// the run has it not, as a latch that never closes.
struct CostValues {
  std::vector<double> a, b;  ///< [unit of the quantity]; b of marks alone
};

/// How far two runs are apart in one quantity [its unit]; infinite where one of them has it not.
struct CostDistance {
  double rms = 0.0;      ///< over the run
  double largest = 0.0;  ///< in time
};

/// Over the samples that both have.
CostDistance DistanceOf(const CostValues& a, const CostValues& b);

/// What an error is told as a part of: the range of motion (of a mark the diagonal of the box that
/// its path fills); of a number its magnitude [unit of the quantity].
double ScaleOf(const CostQuantity& quantity, const CostValues& values);

/// Events of a run by name, in order of time [s].
using CostEvents = std::vector<std::pair<std::string, double>>;

/// A series of one run at the times of another's: the same part of the way from each event that
/// both have to the next. Samples are `step` [s] apart from 0 on. Nothing is interpolated across an
/// event.
std::vector<double> FromEventToEvent(const std::vector<double>& series, double step,
                                     const CostEvents& own, const CostEvents& others);

}  // namespace unfurl::study
