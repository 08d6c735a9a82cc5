#pragma once

namespace unfurl::sim {

/// What may happen at an instant of a run.
enum class EventKind { kLatch, kContactStart, kContactEnd, kWatch };
inline constexpr int kEventKinds = 4;   // how many there are
const char* EventName(EventKind kind);  ///< "latch", "contact_start", "contact_end", "watch"

/// One of them.
struct Event {
  double t = 0.0;  // [s]
  EventKind kind = EventKind::kLatch;
  int latch = -1;            // index into Model::latches; -1 for a watch
  int joint = -1;            // index into Model::joints; -1 for a watch
  int watch = -1;            // index into Model::watches, for a watch
  bool upper = true;         // which stop, for contacts; for a watch, whether it rose
  double theta_rate = 0.0;   // [rad/s]
  double duration = 0.0;     // contact_end: how long it lasted [s]
  double restitution = 0.0;  // contact_end: -theta_rate(end) / theta_rate(start) [-]
};

/// Impacts of a latch on its stops, and how many of them have ended.
struct LatchImpacts {
  long upper = 0, lower = 0, ended = 0;
};

}  // namespace unfurl::sim
