#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace unfurl::correlate {

/// A record of even steps with what single missing samples of it would have been.
struct BridgedRecord {
  std::vector<double> t;               ///< the grid's where something was put in, else as given [s]
  std::vector<std::vector<double>> x;  ///< the signals [their units]
  std::size_t filled = 0;              ///< samples put in; 0: none is missing, or too many
};

/// Puts in what is missing of `signals`, all at the stamps `t`, where these lie on an even grid but
/// for at most a twentieth of it: the values that an autoregression of the samples that are there
/// finds likeliest [Janssen, Veldhuis and Vries 1986]. So one reading that was put aside leaves a
/// spectrum as it was. For transforms and ratings alone, which need the grid: what is put in is no
/// measurement. Elsewhere all is as given.
BridgedRecord BridgeGaps(std::span<const double> t,
                         const std::vector<std::span<const double>>& signals);

}  // namespace unfurl::correlate
