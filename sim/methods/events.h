#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "sim/methods/event.h"
#include "sim/methods/stepper.h"

namespace unfurl::sim {

// Name of the joint or of the watch.
const std::string& PlaceOf(const Model& model, const Event& event);

// Finds where a latch closes, a contact starts or ends, or a watched quantity crosses its level
// within a step, on its dense output, to rounding: without a miss, however often the dense output
// passes the level. Where the dense output costs evaluations, it is asked for only if the cubic
// through both ends, with its margin of error, does not rule an event out.
class EventFinder {
 public:
  explicit EventFinder(const Model& model);

  // Whether there is anything to find.
  bool empty() const { return model_.latches.count() == 0 && model_.watches.count() == 0; }

  // The first event in the step just tried by `stepper`; false when there is none. `sigma` is its
  // place in the step, just past the crossing.
  bool FindFirst(Stepper& stepper, const std::vector<LatchMode>& modes, double* sigma);

  // Changes the modes for all events that are due at state `y` (at least the one just found), and
  // appends them to `events`. Returns the watch that ends the run, or -1.
  int Apply(const double* y, double t, std::vector<LatchMode>* modes, std::vector<Event>* events);
  // After a step without an event.
  void Follow(const double* y);

 private:
  // Crossing of e = side * (theta - level) to above zero.
  struct Stop {
    EventKind kind = EventKind::kLatch;
    bool upper = true;
    double side = 1.0, level = 0.0;  // [-], [rad]
  };
  struct Started {
    double t = 0.0, theta_rate = 0.0;  // [s], [rad/s]
  };
  enum class Side : std::uint8_t { kUnknown, kBelow, kAbove };

  int Stops(int latch, const LatchMode& mode, Stop out[3]) const;
  Event Make(int latch, double t, double rate, EventKind kind, bool upper);
  void FindLatch(Stepper& stepper, int latch, const LatchMode& mode);
  void FindWatch(Stepper& stepper, int watch);
  double Polished(Stepper& stepper, int watch, const DensePolynomial& p, double at);
  void Switch(const Stop& stop, LatchMode* mode) const;
  // theta of a latch's joint within the step.
  DensePolynomial Theta(Stepper& stepper, int latch, bool cubic, double* margin) const;
  // A watched quantity less its level within the step; for one that is not linear in the state, the
  // polynomial through it at kNodes points.
  DensePolynomial Beyond(Stepper& stepper, int watch, bool cubic, double* margin);
  double BeyondAt(Stepper& stepper, int watch, double sigma);

  const Model& model_;
  std::vector<int> joint_of_;
  std::vector<std::array<Started, 2>> started_;  // by latch: upper, lower
  std::vector<Side> side_;                       // of its level, by watch
  std::vector<double> probe_;                    // entries of a state that a watch takes [SI]
  double first_ = 2.0;                           // of what was found in the step [part of it]
  int pending_latch_ = -1, pending_watch_ = -1;
  Stop pending_;
};

}  // namespace unfurl::sim
