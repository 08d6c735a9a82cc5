#pragma once

#include <string>
#include <vector>

#include "sim/stepper.h"

namespace unfurl::sim {

enum class EventKind { kLatch, kContactStart, kContactEnd };
const char* EventName(EventKind kind);  // "latch", "contact_start", "contact_end"

struct Event {
  double t = 0.0;  // [s]
  EventKind kind = EventKind::kLatch;
  int latch = -1;            // index into Model::latches
  int joint = -1;            // index into Model::joints
  bool upper = true;         // which stop, for contacts
  double theta_rate = 0.0;   // [rad/s]
  double duration = 0.0;     // contact_end: how long it lasted [s]
  double restitution = 0.0;  // contact_end: -theta_rate(end) / theta_rate(start) [-]
};

// Finds where a latch closes or a contact starts or ends within a step, on its dense output, to
// rounding. Dips below a stop that begin and end within one step are found too.
class EventFinder {
 public:
  explicit EventFinder(const Model& model);

  // The first event in the step just tried by `stepper`; false when there is none. `sigma` is its
  // place in the step, just past the crossing.
  bool FindFirst(Stepper& stepper, const std::vector<LatchMode>& modes, double* sigma);

  // Changes the modes for all events that are due at state `y` (at least the one just found), and
  // appends them to `events`.
  void Apply(const double* y, double t, std::vector<LatchMode>* modes, std::vector<Event>* events);

 private:
  // Crossing of e = side * (theta - level) to above zero.
  struct Watch {
    EventKind kind = EventKind::kLatch;
    bool upper = true;
    double side = 1.0, level = 0.0;
  };
  struct Started {
    double t = 0.0, theta_rate = 0.0;
  };
  int Watches(int latch, const LatchMode& mode, Watch out[3]) const;
  Event Make(int latch, double t, double rate, EventKind kind, bool upper);

  const Model& model_;
  std::vector<int> joint_of_;
  std::vector<std::array<Started, 2>> started_;  // by latch: upper, lower
  int pending_latch_ = -1;
  Watch pending_;
};

}  // namespace unfurl::sim
