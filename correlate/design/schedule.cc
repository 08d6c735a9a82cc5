#include "correlate/design/schedule.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "base/random.h"

namespace unfurl::correlate {

namespace {

using Cycle = std::vector<int>;

// Cycles that are all looked at: a cost takes about a millisecond.
constexpr double kAll = 3000.0;
constexpr int kStarts = 6;  // at random, beside the cycle as it is and one for each mark

class SlotSearch {
 public:
  explicit SlotSearch(const ScheduleSearch& search) : search_(search) {
    for (std::size_t s = 0; s < search.now.size(); ++s) {
      if (search.now[s] >= 0) free_.push_back(s);
    }
  }

  void LookAtAll() {
    Cycle cycle = search_.now;
    for (const std::size_t s : free_) cycle[s] = 0;
    while (true) {
      CostOf(cycle);
      std::size_t k = 0;
      while (k < free_.size() && ++cycle[free_[k]] == static_cast<int>(search_.marks)) {
        cycle[free_[k++]] = 0;
      }
      if (k == free_.size()) return;
    }
  }

  void Exchange() {
    Improve(search_.now);
    for (std::size_t m = 0; m < search_.marks; ++m) {
      Cycle cycle = search_.now;
      for (std::size_t i = 0; i < free_.size(); ++i) {
        if (i >= search_.kept.size()) cycle[free_[i]] = static_cast<int>(m);
      }
      for (std::size_t i = 0; i < std::min(free_.size(), search_.kept.size()); ++i) {
        cycle[free_[i]] = static_cast<int>(search_.kept[i]);
      }
      Improve(cycle);
    }
    Rng rng(1);
    for (int k = 0; k < kStarts; ++k) {
      Cycle cycle = search_.now;
      for (const std::size_t s : free_) {
        cycle[s] = static_cast<int>(rng.Uniform() * static_cast<double>(search_.marks));
      }
      Improve(cycle);
    }
  }

  // The cheapest, and of those that are as cheap the one nearest to the cycle as it is.
  Cycle Best() const {
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [cycle, cost] : known_) least = std::min(least, cost);
    Cycle best = search_.now;
    std::optional<std::size_t> fewest;
    for (const auto& [cycle, cost] : known_) {
      if (!(cost <= least + search_.alike)) continue;
      std::size_t changed = 0;
      for (std::size_t s = 0; s < cycle.size(); ++s) changed += cycle[s] != search_.now[s] ? 1 : 0;
      if (!fewest || changed < *fewest) fewest = changed, best = cycle;
    }
    return best;
  }

  double Number() const {
    return std::pow(static_cast<double>(search_.marks), static_cast<double>(free_.size()));
  }

 private:
  double CostOf(const Cycle& cycle) {
    const auto [at, first] = known_.try_emplace(cycle, std::numeric_limits<double>::infinity());
    if (!first) return at->second;
    for (const std::size_t m : search_.kept) {
      if (std::find(cycle.begin(), cycle.end(), static_cast<int>(m)) == cycle.end()) {
        return at->second;
      }
    }
    at->second = search_.cost(cycle);
    return at->second;
  }

  // One slot at a time, and where that leads nowhere, two.
  void Improve(Cycle cycle) {
    double cost = CostOf(cycle);
    while (BetterByOne(&cycle, &cost) || BetterByTwo(&cycle, &cost)) {
    }
  }

  bool Try(const Cycle& moved, Cycle* cycle, double* cost) {
    const double there = CostOf(moved);
    if (!(there < *cost)) return false;
    *cycle = moved;
    *cost = there;
    return true;
  }

  bool BetterByOne(Cycle* cycle, double* cost) {
    bool better = false;
    for (const std::size_t s : free_) {
      for (std::size_t m = 0; m < search_.marks; ++m) {
        Cycle moved = *cycle;
        moved[s] = static_cast<int>(m);
        better = Try(moved, cycle, cost) || better;
      }
    }
    return better;
  }

  // Two neighbours swap their marks: what a cycle's order does.
  bool BetterByTwo(Cycle* cycle, double* cost) {
    for (std::size_t i = 0; i + 1 < free_.size(); ++i) {
      Cycle moved = *cycle;
      std::swap(moved[free_[i]], moved[free_[i + 1]]);
      if (Try(moved, cycle, cost)) return true;
    }
    return false;
  }

  const ScheduleSearch& search_;
  std::vector<std::size_t> free_;
  std::map<Cycle, double> known_;
};

}  // namespace

std::vector<int> FindSchedule(const ScheduleSearch& asked) {
  SlotSearch search(asked);
  if (search.Number() <= kAll) {
    search.LookAtAll();
  } else {
    search.Exchange();
  }
  return search.Best();
}

}  // namespace unfurl::correlate
