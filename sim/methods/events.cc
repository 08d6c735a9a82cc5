#include "sim/methods/events.h"

#include <algorithm>
#include <cmath>

#include "sim/methods/crossing.h"

namespace unfurl::sim {
namespace {

constexpr int kNodes = DensePolynomial::kMostCoefficients;
constexpr int kPolishes = 3;  // Newton steps on a quantity that is not a polynomial

// Chebyshev's points in [0, 1], ends included.
double Node(int k) { return 0.5 - 0.5 * std::cos(M_PI * k / (kNodes - 1)); }

// The polynomial through `values` at the nodes, by divided differences.
DensePolynomial Through(std::array<double, kNodes> values) {
  for (int level = 1; level < kNodes; ++level) {
    for (int k = kNodes - 1; k >= level; --k) {
      values[k] = (values[k] - values[k - 1]) / (Node(k) - Node(k - level));
    }
  }
  DensePolynomial p{{values[kNodes - 1]}, kNodes};
  for (int k = kNodes - 2; k >= 0; --k) {
    for (int c = kNodes - 1; c > 0; --c) p.c[c] = p.c[c - 1] - Node(k) * p.c[c];
    p.c[0] = values[k] - Node(k) * p.c[0];
  }
  return p;
}

DensePolynomial NegativeOf(DensePolynomial p) {
  for (double& c : p.c) c = -c;
  return p;
}

}  // namespace

const std::string& PlaceOf(const Model& model, const Event& event) {
  return event.watch >= 0 ? model.watches.at(event.watch).name : model.joints[event.joint].name;
}

const char* EventName(EventKind kind) {
  switch (kind) {
    case EventKind::kLatch:
      return "latch";
    case EventKind::kContactStart:
      return "contact_start";
    case EventKind::kContactEnd:
      return "contact_end";
    default:
      return "watch";
  }
}

EventFinder::EventFinder(const Model& model)
    : model_(model),
      joint_of_(model.latches.count(), -1),
      started_(model.latches.count()),
      side_(model.watches.count(), Side::kUnknown),
      probe_(model.watches.count() > 0 ? model.index.size() : 0, 0.0) {
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    if (model.joints[j].latch >= 0) joint_of_[model.joints[j].latch] = static_cast<int>(j);
  }
}

int EventFinder::Stops(int latch, const LatchMode& mode, Stop out[3]) const {
  const Latches::Stop upper = model_.latches.StopOf(latch, true);
  const Latches::Stop lower = model_.latches.StopOf(latch, false);
  int count = 0;
  if (!mode.latched) {
    out[count++] = {EventKind::kLatch, true, -upper.side, upper.level};
  } else if (mode.upper_contact) {
    out[count++] = {EventKind::kContactEnd, true, -upper.side, upper.level};
  } else {
    out[count++] = {EventKind::kContactStart, true, upper.side, upper.level};
  }
  if (mode.lower_contact) {
    out[count++] = {EventKind::kContactEnd, false, -lower.side, lower.level};
  } else {
    out[count++] = {EventKind::kContactStart, false, lower.side, lower.level};
  }
  return count;
}

DensePolynomial EventFinder::Theta(Stepper& stepper, int latch, bool cubic, double* margin) const {
  const Hinge& hinge = model_.latches.hinge(latch);
  const int outer_entry = model_.index.theta(hinge.outer);
  const int inner_entry = model_.index.theta(hinge.inner);
  double outer_margin = 0.0, inner_margin = 0.0;
  const DensePolynomial outer =
      cubic ? stepper.Cubic(outer_entry, &outer_margin) : stepper.Polynomial(outer_entry);
  const DensePolynomial inner =
      cubic ? stepper.Cubic(inner_entry, &inner_margin) : stepper.Polynomial(inner_entry);
  DensePolynomial theta;
  theta.count = outer.count;
  for (int p = 0; p < theta.count; ++p) theta.c[p] = hinge.sign * (outer.c[p] - inner.c[p]);
  theta.c[0] -= hinge.sign * hinge.zero;
  *margin = outer_margin + inner_margin;
  return theta;
}

void EventFinder::FindLatch(Stepper& stepper, int latch, const LatchMode& mode) {
  Stop stops[3];
  const int count = Stops(latch, mode, stops);
  bool cubic = !stepper.DenseIsFree();
  double margin = 0.0;
  DensePolynomial theta = Theta(stepper, latch, cubic, &margin);
  for (int w = 0; w < count; ++w) {
    const auto beyond = [&] {
      DensePolynomial e;
      e.count = theta.count;
      for (int p = 0; p < e.count; ++p) e.c[p] = stops[w].side * theta.c[p];
      e.c[0] -= stops[w].side * stops[w].level;
      return e;
    };
    if (!MayRise(beyond(), margin)) continue;
    if (cubic) {
      cubic = false;
      theta = Theta(stepper, latch, cubic, &margin);
    }
    const double at = FirstRise(beyond());
    if (at >= 0.0 && at < first_) {
      first_ = at;
      pending_latch_ = latch;
      pending_watch_ = -1;
      pending_ = stops[w];
    }
  }
}

double EventFinder::BeyondAt(Stepper& stepper, int watch, double sigma) {
  for (const int entry : model_.watches.at(watch).entries) {
    probe_[entry] = stepper.Polynomial(entry)(sigma);
  }
  return model_.watches.Beyond(watch, model_.index, probe_.data());
}

DensePolynomial EventFinder::Beyond(Stepper& stepper, int watch, bool cubic, double* margin) {
  const Watches::Watch& w = model_.watches.at(watch);
  *margin = 0.0;
  const auto entry_polynomial = [&](int entry, double* off) {
    *off = 0.0;
    return cubic ? stepper.Cubic(entry, off) : stepper.Polynomial(entry);
  };
  double off = 0.0;
  if (w.Linear()) {
    DensePolynomial sum{{w.constant - w.level}, 1};
    for (const auto& [entry, weight] : w.terms) {
      const DensePolynomial p = entry_polynomial(entry, &off);
      sum.count = std::max(sum.count, p.count);
      for (int k = 0; k < p.count; ++k) sum.c[k] += weight * p.c[k];
      *margin += std::fabs(weight) * off;
    }
    return sum;
  }
  constexpr int kMostEntries = 12;  // a travel's rate: positions and rates of two bodies
  DensePolynomial of[kMostEntries];
  double offs[kMostEntries];
  const int entries = static_cast<int>(w.entries.size());
  for (int e = 0; e < entries; ++e) of[e] = entry_polynomial(w.entries[e], &offs[e]);
  std::array<double, kNodes> values;
  for (int k = 0; k < kNodes; ++k) {
    for (int e = 0; e < entries; ++e) probe_[w.entries[e]] = of[e](Node(k));
    values[k] = model_.watches.Beyond(watch, model_.index, probe_.data());
    if (!cubic) continue;
    // What the margins of the entries change the quantity by, at this node.
    double moved = 0.0;
    for (int e = 0; e < entries; ++e) {
      const double kept = probe_[w.entries[e]];
      probe_[w.entries[e]] += offs[e];
      moved += std::fabs(model_.watches.Beyond(watch, model_.index, probe_.data()) - values[k]);
      probe_[w.entries[e]] = kept;
    }
    *margin = std::max(*margin, 2.0 * moved);
  }
  return Through(values);
}

namespace {

// The sign of a polynomial just after its start.
bool LeavesUpwards(const DensePolynomial& p) {
  int leading = 0;
  while (leading + 1 < p.count && p.c[leading] == 0.0) ++leading;
  return p.c[leading] > 0.0;
}

}  // namespace

void EventFinder::FindWatch(Stepper& stepper, int watch) {
  const Watches::Watch& w = model_.watches.at(watch);
  const bool cubic = !stepper.DenseIsFree();
  double margin = 0.0;
  DensePolynomial p = Beyond(stepper, watch, cubic, &margin);
  if (side_[watch] == Side::kUnknown) {
    side_[watch] = LeavesUpwards(p) ? Side::kAbove : Side::kBelow;
  }
  if (cubic) {
    const bool above = side_[watch] == Side::kAbove;
    // Far from the level, on the side where it was.
    DensePolynomial towards = above ? NegativeOf(p) : p;
    towards.c[0] += margin;
    if (FirstAbove(towards, 0.0) < 0.0 && towards.c[0] <= 0.0) return;
    p = Beyond(stepper, watch, false, &margin);
  }
  for (const bool up : {true, false}) {
    if (!(up ? w.rising : w.falling)) continue;
    const DensePolynomial e = up ? p : NegativeOf(p);
    double at = FirstUpcrossing(e, (side_[watch] == Side::kAbove) == up);
    if (at < 0.0) continue;
    if (!w.Linear()) at = Polished(stepper, watch, p, at);
    if (at < first_) {
      first_ = at;
      pending_latch_ = -1;
      pending_watch_ = watch;
      pending_.upper = up;
    }
  }
}

// The interpolant's crossing of a quantity that is not linear in the state, by Newton's method on
// the quantity itself, with the interpolant's slope.
double EventFinder::Polished(Stepper& stepper, int watch, const DensePolynomial& p, double at) {
  for (int k = 0; k < kPolishes; ++k) {
    const double slope = p.Slope(at);
    if (slope == 0.0) break;
    at = std::clamp(at - BeyondAt(stepper, watch, at) / slope, 0.0, 1.0);
  }
  return at;
}

bool EventFinder::FindFirst(Stepper& stepper, const std::vector<LatchMode>& modes, double* sigma) {
  first_ = 2.0;
  pending_latch_ = pending_watch_ = -1;
  for (int k = 0; k < model_.latches.count(); ++k) FindLatch(stepper, k, modes[k]);
  for (int k = 0; k < model_.watches.count(); ++k) FindWatch(stepper, k);
  *sigma = first_;
  return first_ <= 1.0;
}

void EventFinder::Follow(const double* y) {
  for (int k = 0; k < model_.watches.count(); ++k) {
    const Watches::Watch& w = model_.watches.at(k);
    if (w.rising && w.falling) continue;
    // The way back, which does not count.
    const double beyond = model_.watches.Beyond(k, model_.index, y);
    if (w.rising && beyond < 0.0) side_[k] = Side::kBelow;
    if (w.falling && beyond > 0.0) side_[k] = Side::kAbove;
  }
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

void EventFinder::Switch(const Stop& stop, LatchMode* mode) const {
  std::uint8_t& contact = stop.upper ? mode->upper_contact : mode->lower_contact;
  switch (stop.kind) {
    case EventKind::kLatch:
      mode->latched = 1;
      break;
    case EventKind::kContactStart:
      contact = 1;
      break;
    case EventKind::kContactEnd:
      contact = 0;
      break;
    case EventKind::kWatch:
      break;
  }
}

int EventFinder::Apply(const double* y, double t, std::vector<LatchMode>* modes,
                       std::vector<Event>* events) {
  Stop stops[3];
  for (int k = 0; k < model_.latches.count(); ++k) {
    const Hinge& hinge = model_.latches.hinge(k);
    const StateIndex& index = model_.index;
    const double theta =
        hinge.sign * (y[index.theta(hinge.outer)] - y[index.theta(hinge.inner)] - hinge.zero);
    const double rate = hinge.sign * (y[index.omega(hinge.outer)] - y[index.omega(hinge.inner)]);
    const int count = Stops(k, (*modes)[k], stops);
    for (int w = 0; w < count; ++w) {
      const Stop& stop = stops[w];
      const bool found =
          k == pending_latch_ && stop.kind == pending_.kind && stop.upper == pending_.upper;
      const double beyond = stop.side * (theta - stop.level);
      if (!found && !(beyond > 0.0 && stop.side * rate > 0.0)) continue;
      Switch(stop, &(*modes)[k]);
      events->push_back(Make(k, t, rate, stop.kind, stop.upper));
    }
  }
  int ending = -1;
  if (pending_watch_ >= 0) {
    Event event;
    event.t = t;
    event.kind = EventKind::kWatch;
    event.watch = pending_watch_;
    event.upper = pending_.upper;
    events->push_back(event);
    side_[pending_watch_] = pending_.upper ? Side::kAbove : Side::kBelow;
    if (model_.watches.at(pending_watch_).stop) ending = pending_watch_;
  }
  pending_latch_ = pending_watch_ = -1;
  return ending;
}

}  // namespace unfurl::sim
