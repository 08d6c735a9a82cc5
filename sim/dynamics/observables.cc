#include "sim/dynamics/observables.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "base/error.h"
#include "base/text.h"

namespace unfurl::sim {

namespace {

// `turn`: cosine and sine of a body's angle.
template <typename Turn>
PointMotion PointAt(const Model& model, const MovingPoint& p, const double* state, Turn turn) {
  const StateIndex& i = model.index;
  if (p.watched >= 0) {
    const KirchhoffRod::Frame f = model.kirchhoff.MotionAt(p.watched, state, i.n);
    return {f.x, f.y, f.vx, f.vy};
  }
  if (p.other_body >= 0) {
    const PointMotion a = PointAt(model, {p.body, p.px, p.py}, state, turn);
    const PointMotion b = PointAt(model, {p.other_body, p.other_px, 0.0}, state, turn);
    const double w = p.other_share, v = 1.0 - w;
    return {v * a.x + w * b.x, v * a.y + w * b.y, v * a.vx + w * b.vx, v * a.vy + w * b.vy};
  }
  const auto [c, s] = turn(p.body);
  const double ox = c * p.px - s * p.py, oy = s * p.px + c * p.py;
  const double w = state[i.omega(p.body)];
  return {state[i.x(p.body)] + ox, state[i.y(p.body)] + oy, state[i.vx(p.body)] - w * oy,
          state[i.vy(p.body)] + w * ox};
}

}  // namespace

PointMotion MotionOf(const Model& model, const MovingPoint& point, const double* state) {
  return PointAt(model, point, state, [&](int body) {
    const double theta = state[model.index.theta(body)];
    return std::pair{std::cos(theta), std::sin(theta)};
  });
}

PointMotion MotionOf(const Model& model, const MovingPoint& point, const Motion& motion) {
  return PointAt(model, point, motion.x, [&](int body) {
    return std::pair{motion.c[body], motion.s[body]};
  });
}

double LatchMoment(const Model& model, int latch, const double* state, const LatchMode& mode) {
  const int n = model.index.n;
  const Motion motion{0.0,           state,         state + n, state + 2 * n, state + 3 * n,
                      state + 4 * n, state + 5 * n, nullptr,   nullptr};
  return model.latches.Moment(latch, motion, mode);
}

std::string NameOfRigidBody(const Model& model, int body) {
  for (const Model::Beam& beam : model.beams) {
    if (body == beam.first && beam.smooth >= 0) return fmt::format("beam '{}'", beam.name);
    if (body >= beam.first && body < beam.first + beam.segments) {
      return fmt::format("beam '{}', segment {}", beam.name, body - beam.first + 1);
    }
  }
  for (int b = 0; b < model.kirchhoff.count(); ++b) {
    const KirchhoffBeams::Beam& beam = model.kirchhoff.beam(b);
    const int k = body - beam.first_amplitude();
    if (k >= 0 && k < beam.amplitude_bodies()) {
      return fmt::format("beam '{}', amplitudes from {}", beam.name, 3 * k + 1);
    }
  }
  for (const Model::Body& part : model.bodies) {
    if (part.centre.body == body) return fmt::format("body '{}'", part.name);
  }
  for (const Model::EndBody& end : model.end_bodies) {
    if (end.body == body) return fmt::format("beam end '{}'", end.name);
  }
  return body == model.rigid_bodies.ground ? "the ground" : "a welded end of a beam";
}

namespace {

// * stands for any letters, ? for one.
bool Fits(const char* pattern, const char* name) {
  for (; *pattern != '\0'; ++pattern, ++name) {
    if (*pattern == '*') {
      for (const char* rest = name;; ++rest) {
        if (Fits(pattern + 1, rest)) return true;
        if (*rest == '\0') return false;
      }
    }
    if (*name == '\0' || (*pattern != '?' && *pattern != *name)) return false;
  }
  return *name == '\0';
}

}  // namespace

Observables::Observables(const Model& model, const std::vector<std::string>& wanted)
    : model_(model),
      dynamics_(model),
      margins_(model),
      forces_(model),
      sensors_(model),
      rates_(model.index.size(), 0.0) {
  for (const Model::Beam& beam : model.beams) {
    lines_.emplace_back(model, beam);
    places_.push_back(ShapePlaces(beam));
  }
  MakeOutlines();
  Declare();
  if (!wanted.empty()) Keep(wanted);
  for (const data::Quantity& q : quantities_) {
    for (const char* part : {".pin_force", ".drive_", ".hold_"}) {
      wants_forces_ = wants_forces_ || q.name.find(part) != std::string::npos;
    }
  }
  for (const Model::Sensor& s : model.sensors) {
    for (const data::Quantity& q : quantities_) {
      wants_sensors_ = wants_sensors_ || q.name.starts_with(s.name + ".");
    }
  }
  row_.reserve(quantities_.size());
}

void Observables::Add(const std::string& name, const char* units, const std::string& what,
                      Value value, int index) {
  quantities_.push_back({name, units, what});
  columns_.push_back({value, index});
}

void Observables::Keep(const std::vector<std::string>& wanted) {
  std::vector<bool> used(wanted.size(), false);
  std::size_t kept = 0;
  for (std::size_t q = 0; q < quantities_.size(); ++q) {
    bool keep = false;
    for (std::size_t k = 0; k < wanted.size(); ++k) {
      if (!Fits(wanted[k].c_str(), quantities_[q].name.c_str())) continue;
      keep = used[k] = true;
    }
    if (!keep) continue;
    std::swap(quantities_[kept], quantities_[q]);
    columns_[kept++] = columns_[q];
  }
  for (std::size_t k = 0; k < wanted.size(); ++k) {
    if (used[k]) continue;
    std::vector<std::string> names;
    for (const data::Quantity& q : quantities_) names.push_back(q.name);
    const std::string nearest = NearestName(wanted[k], names);
    throw Error(fmt::format("the scene has no quantity '{}'", wanted[k]), "option quantities",
                nearest.empty() ? "name quantities of a run, such as 'joint1.*' or 'energy.*'"
                                : "did you mean '" + nearest + "'?");
  }
  quantities_.resize(kept);
  columns_.resize(kept);
}

std::vector<std::string> Observables::marks() const {
  const auto has = [&](const std::string& name) {
    return std::any_of(quantities_.begin(), quantities_.end(),
                       [&](const data::Quantity& q) { return q.name == name; });
  };
  std::vector<std::string> names;
  for (const Model::Mark& mark : model_.marks) {
    if (has(mark.name + ".x") && has(mark.name + ".y")) names.push_back(mark.name);
  }
  return names;
}

std::vector<data::BeamShape> Observables::shapes() const {
  std::vector<data::BeamShape> shapes;
  for (std::size_t b = 0; b < places_.size(); ++b) {
    shapes.push_back({model_.beams[b].name, places_[b], data::ShapeKind::kBeam});
  }
  for (const Outline& outline : outlines_) {
    shapes.push_back(
        {outline.name, std::vector<double>(outline.points.size(), 0.0), data::ShapeKind::kBody});
  }
  for (const Model::Joint& joint : model_.joints) {
    shapes.push_back({joint.name, {0.0}, data::ShapeKind::kPin});
  }
  return shapes;
}

// A star over each rigid body (those welded together are one): from the centre of the first of them
// to every joint, mark, beam's end and other centre on it.
void Observables::MakeOutlines() {
  std::vector<MovingPoint> held;
  const auto hold = [&](int body, double px, double py) {
    MovingPoint point;
    point.body = body, point.px = px, point.py = py;
    held.push_back(point);
  };
  for (const Model::Body& body : model_.bodies) held.push_back(body.centre);
  for (const Model::Joint& joint : model_.joints) {
    const Coordinate& c = joint.coordinate;
    hold(c.hinge.inner, c.ix, c.iy);
    held.push_back(joint.pin);
  }
  for (const Model::Mark& mark : model_.marks) held.push_back(mark.point);
  for (const Station& station : model_.rigid_bodies.stations)
    hold(station.body, station.px, station.py);
  std::set<int> done;
  for (const Model::Body& body : model_.bodies) {
    if (!done.insert(body.centre.body).second) continue;
    Outline outline{body.name, {body.centre}};
    for (const MovingPoint& point : held) {
      const bool same = point.px == body.centre.px && point.py == body.centre.py;
      if (point.body != body.centre.body || point.other_body >= 0 || same) continue;
      outline.points.push_back(point);
      outline.points.push_back(body.centre);
    }
    outlines_.push_back(std::move(outline));
  }
}

const std::vector<double>& Observables::Row(double time, double* state,
                                            const std::vector<LatchMode>& modes) {
  // What jumps at the end of the run jumps after it.
  const double t = time == model_.duration ? std::nextafter(time, 0.0) : time;
  dynamics_.modes() = modes;
  balance_ = dynamics_.BalanceAt(t, state);
  if (!started_) {
    start_ = balance_.Conserved();
    started_ = true;
  }
  if (wants_forces_ || (wants_sensors_ && sensors_.NeedsRates())) {
    dynamics_.RightSide(t, state, rates_.data());
  }
  if (wants_sensors_) sensors_.Read(t, state, rates_.data(), &dynamics_);
  const Motion motion = dynamics_.Update(t, state);
  margins_.Watch(motion, modes);
  const Frame frame{*this, motion, modes};
  row_.clear();
  for (const Column& column : columns_) row_.push_back(column.value(frame, column.index));
  return row_;
}

const std::vector<double>& Observables::ShapeRow(double t, double* state) {
  const Motion motion = dynamics_.Update(t, state);
  shape_row_.clear();
  for (std::size_t b = 0; b < lines_.size(); ++b) {
    for (const double place : places_[b]) {
      const PlanePoint p = lines_[b].At(motion, place);
      shape_row_.push_back(p.x);
      shape_row_.push_back(p.y);
    }
  }
  const auto add = [&](const MovingPoint& point) {
    const PointMotion p = MotionOf(model_, point, motion);
    shape_row_.push_back(p.x);
    shape_row_.push_back(p.y);
  };
  for (const Outline& outline : outlines_) {
    for (const MovingPoint& point : outline.points) add(point);
  }
  for (const Model::Joint& joint : model_.joints) add(joint.pin);
  return shape_row_;
}

}  // namespace unfurl::sim
