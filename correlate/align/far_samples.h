#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "correlate/observations.h"

namespace unfurl::correlate {

/// A sample that lies further from its neighbours in time than its mark moves between them.
struct FarSample {
  std::size_t mark = 0, index = 0;  ///< into Observations::marks and its samples
  double distance = 0.0;            ///< from where its neighbours place it [m]
};

/// Gross errors that show before any model is asked, by mark, then time. A sample is placed by the
/// straight lines between the three samples before it and the three after, by the median of the
/// nine, coordinate by coordinate, or by where either side's last step leads (an impact). It is far
/// where it lies off from all of these by more than chance brings to one sample of the mark in a
/// hundred records, and by more than twice the median step of those neighbours. Errors smaller than
/// the motion are for a fit to find (FindGrossErrors).
std::vector<FarSample> FindFarSamples(const Observations& observations);

/// Likewise among the readings of each of its other kinds, by index: kind, then reading.
std::vector<std::vector<std::size_t>> FindFarReadings(const Observations& observations);

/// Likewise of one record.
std::vector<std::size_t> FindFarReadings(const std::vector<double>& t, const Eigen::VectorXd& y);

/// What they are, the first by name; `far` must not be empty.
std::string Words(const Observations& observations, const std::vector<FarSample>& far);

/// The same samples, the far ones with covariances as wide as they are off.
Observations Widened(Observations observations, const std::vector<FarSample>& far);

/// The same readings, the far ones put aside.
Observations Aside(Observations observations, const std::vector<std::vector<std::size_t>>& far);

/// All samples but the far ones.
Observations Without(const Observations& observations, const std::vector<FarSample>& far);

}  // namespace unfurl::correlate
