#include "sim/events.h"

#include <cmath>

namespace unfurl::sim {
namespace {

constexpr int kBisections = 52;  // down to rounding of sigma

// f(low) <= 0 < f(high): returns the upper end of the last bracket, where f > 0.
template <typename F>
double Bisect(double low, double high, F f) {
  for (int k = 0; k < kBisections; ++k) {
    const double middle = 0.5 * (low + high);
    (f(middle) > 0.0 ? high : low) = middle;
  }
  return high;
}

// Where e first rises above zero in (0, 1]; -1 when it does not.
double FirstCrossing(const DensePolynomial& e) {
  const double start = e.c[0], end = e(1.0);
  const double slope_start = e.c[1], slope_end = e.Slope(1.0);
  if (start <= 0.0) {
    if (end > 0.0) return Bisect(0.0, 1.0, e);
    // Both ends below: a rise and fall between them?
    if (!(slope_start > 0.0 && slope_end < 0.0)) return -1.0;
    if (start + slope_start <= 0.0 && end - slope_end <= 0.0) return -1.0;
    const double top = Bisect(0.0, 1.0, [&](double s) { return -e.Slope(s); });
    return e(top) > 0.0 ? Bisect(0.0, top, e) : -1.0;
  }
  // Already above, by rounding or since it was just left: it counts once it turns up again.
  if (slope_start >= 0.0) return 0.0;
  if (end <= 0.0 || slope_end <= 0.0) return -1.0;
  const double bottom = Bisect(0.0, 1.0, [&](double s) { return e.Slope(s); });
  return e(bottom) < 0.0 ? Bisect(bottom, 1.0, e) : bottom;
}

}  // namespace

const char* EventName(EventKind kind) {
  switch (kind) {
    case EventKind::kLatch:
      return "latch";
    case EventKind::kContactStart:
      return "contact_start";
    default:
      return "contact_end";
  }
}

EventFinder::EventFinder(const Model& model)
    : model_(model), joint_of_(model.latches.count(), -1), started_(model.latches.count()) {
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    if (model.joints[j].latch >= 0) joint_of_[model.joints[j].latch] = static_cast<int>(j);
  }
}

int EventFinder::Watches(int latch, const LatchMode& mode, Watch out[3]) const {
  const Latches::Law& law = model_.latches.law(latch);
  int count = 0;
  if (!mode.latched) {
    out[count++] = {EventKind::kLatch, true, -1.0, law.theta_a};
  } else if (mode.upper_contact) {
    out[count++] = {EventKind::kContactEnd, true, -1.0, law.theta_a};
  } else {
    out[count++] = {EventKind::kContactStart, true, 1.0, law.theta_a};
  }
  if (mode.lower_contact) {
    out[count++] = {EventKind::kContactEnd, false, 1.0, -law.theta_b};
  } else {
    out[count++] = {EventKind::kContactStart, false, -1.0, -law.theta_b};
  }
  return count;
}

bool EventFinder::FindFirst(Stepper& stepper, const std::vector<LatchMode>& modes, double* sigma) {
  double first = 2.0;
  Watch watches[3];
  for (int k = 0; k < model_.latches.count(); ++k) {
    const Hinge& hinge = model_.latches.hinge(k);
    const DensePolynomial outer = stepper.Polynomial(model_.index.theta(hinge.outer));
    const DensePolynomial inner = stepper.Polynomial(model_.index.theta(hinge.inner));
    DensePolynomial theta;
    theta.count = outer.count;
    for (int p = 0; p < theta.count; ++p) theta.c[p] = hinge.sign * (outer.c[p] - inner.c[p]);
    theta.c[0] -= hinge.sign * hinge.zero;
    const int count = Watches(k, modes[k], watches);
    for (int w = 0; w < count; ++w) {
      DensePolynomial e;
      e.count = theta.count;
      for (int p = 0; p < e.count; ++p) e.c[p] = watches[w].side * theta.c[p];
      e.c[0] -= watches[w].side * watches[w].level;
      const double at = FirstCrossing(e);
      if (at >= 0.0 && at < first) {
        first = at;
        pending_latch_ = k;
        pending_ = watches[w];
      }
    }
  }
  *sigma = first;
  return first <= 1.0;
}

Event EventFinder::Make(int latch, double t, double rate, EventKind kind, bool upper) {
  Event event;
  event.t = t;
  event.kind = kind;
  event.latch = latch;
  event.joint = joint_of_[latch];
  event.upper = upper;
  event.theta_rate = rate;
  Started& started = started_[latch][upper ? 0 : 1];
  if (kind == EventKind::kContactStart) {
    started = {t, rate};
  } else if (kind == EventKind::kContactEnd) {
    event.duration = t - started.t;
    event.restitution = started.theta_rate != 0.0 ? -rate / started.theta_rate : 0.0;
  }
  return event;
}

void EventFinder::Apply(const double* y, double t, std::vector<LatchMode>* modes,
                        std::vector<Event>* events) {
  Watch watches[3];
  for (int k = 0; k < model_.latches.count(); ++k) {
    const Hinge& hinge = model_.latches.hinge(k);
    const StateIndex& index = model_.index;
    const double theta =
        hinge.sign * (y[index.theta(hinge.outer)] - y[index.theta(hinge.inner)] - hinge.zero);
    const double rate = hinge.sign * (y[index.omega(hinge.outer)] - y[index.omega(hinge.inner)]);
    const int count = Watches(k, (*modes)[k], watches);
    for (int w = 0; w < count; ++w) {
      const Watch& watch = watches[w];
      const bool found =
          k == pending_latch_ && watch.kind == pending_.kind && watch.upper == pending_.upper;
      const double beyond = watch.side * (theta - watch.level);
      if (!found && !(beyond > 0.0 && watch.side * rate > 0.0)) continue;
      LatchMode& mode = (*modes)[k];
      switch (watch.kind) {
        case EventKind::kLatch:
          mode.latched = 1;
          break;
        case EventKind::kContactStart:
          (watch.upper ? mode.upper_contact : mode.lower_contact) = 1;
          break;
        case EventKind::kContactEnd:
          (watch.upper ? mode.upper_contact : mode.lower_contact) = 0;
          break;
      }
      events->push_back(Make(k, t, rate, watch.kind, watch.upper));
    }
  }
  pending_latch_ = -1;
}

}  // namespace unfurl::sim
