#pragma once

#include <array>
#include <vector>

#include "sim/methods/event.h"

namespace unfurl::sim {

// Events in bounded memory: all are counted, the first and the last kKept are kept.
class EventLog {
 public:
  static constexpr int kKept = 5000;  // at each end

  explicit EventLog(int latches) : latches_(latches) {}

  void Add(const Event& event);
  long Count(EventKind kind) const { return counts_[static_cast<int>(kind)]; }
  const std::array<long, kEventKinds>& counts() const { return counts_; }
  const std::vector<LatchImpacts>& latches() const { return latches_; }
  // Those kept, in order of time; `left_out`: how many in the middle are not among them.
  std::vector<Event> Kept(long* left_out) const;

 private:
  std::array<long, kEventKinds> counts_{};
  std::vector<LatchImpacts> latches_;
  std::vector<Event> first_, last_;  // last_: a ring
  std::size_t next_ = 0;             // place in the ring
  long total_ = 0;
};

}  // namespace unfurl::sim
