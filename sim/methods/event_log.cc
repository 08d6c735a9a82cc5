#include "sim/methods/event_log.h"

namespace unfurl::sim {

void EventLog::Add(const Event& event) {
  ++total_;
  ++counts_[static_cast<int>(event.kind)];
  if (event.latch >= 0) {
    LatchImpacts& count = latches_[event.latch];
    if (event.kind == EventKind::kContactStart) ++(event.upper ? count.upper : count.lower);
    if (event.kind == EventKind::kContactEnd) ++count.ended;
  }
  if (first_.size() < kKept) {
    first_.push_back(event);
  } else if (last_.size() < kKept) {
    last_.push_back(event);
  } else {
    last_[next_] = event;
    next_ = (next_ + 1) % kKept;
  }
}

std::vector<Event> EventLog::Kept(long* left_out) const {
  std::vector<Event> kept = first_;
  for (std::size_t k = 0; k < last_.size(); ++k) {
    kept.push_back(last_[(next_ + k) % last_.size()]);
  }
  *left_out = total_ - static_cast<long>(kept.size());
  return kept;
}

}  // namespace unfurl::sim
