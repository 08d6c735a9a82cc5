#pragma once

#include <string>
#include <vector>

#include "correlate/observations.h"

namespace unfurl::correlate {

/// Light-emitting diodes that flash one after another, one to a line of the sensors, in a cycle.
struct Strobe {
  double line = 0.0;               ///< duration of a line [s]; 0: there is no such cycle
  double first = 0.0;              ///< stamp of a line of slot 0 [s]
  std::vector<std::string> slots;  ///< the mark lit in each line; empty: none, or not known
  std::string why;                 ///< where there is no cycle: what speaks against one

  /// Slot of the line at stamp t [s]; -1: there is no cycle.
  int SlotAt(double t) const;
};

/// The cycle that the stamps of a record show: each mark at even steps, each at a time of its own.
/// The shortest gap between two marks is taken for the line; lines in which no mark is seen are
/// dark.
Strobe FindStrobe(const Observations& observations);

}  // namespace unfurl::correlate
