#pragma once

#include <functional>
#include <vector>

namespace unfurl::correlate {

/// A strobe's cycle to be filled with marks.
struct ScheduleSearch {
  std::size_t marks = 0;          ///< that may be lit
  std::vector<int> now;           ///< by slot: the mark that is lit; -1: none, and it stays
  std::vector<std::size_t> kept;  ///< marks that are lit at least once
  std::function<double(const std::vector<int>&)> cost;  ///< of a cycle; less is better, may be inf
  /// Cycles that cost more by less than this are as good: of them the one that changes least [-].
  double alike = 0.01;
};

/// The cheapest cycle: of all, where these are few, else the best that exchanges of one slot, and
/// swaps of neighbours, lead to from several starts (after the exchange of [Fedorov 1972]).
std::vector<int> FindSchedule(const ScheduleSearch& search);

}  // namespace unfurl::correlate
