// From a scene to a model: merge welded bodies, number the slots, place everything, fill the
// effects, and check that the constraints are independent.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "sim/assembly.h"
#include "sim/composites.h"
#include "sim/dynamics.h"
#include "sim/model.h"

namespace unfurl::sim {
namespace {

using data::SceneEnd;

// A pivot of the Schur complement this small beside its diagonal entry means redundant constraints.
constexpr double kRedundant = 1e-11;

bool IsBeam(const SceneEnd& end) {
  return end.kind == SceneEnd::Kind::kBeamStart || end.kind == SceneEnd::Kind::kBeamEnd;
}

class Compiler {
 public:
  explicit Compiler(const data::Scene& scene) : scene_(scene), merged_(MergeWeldedBodies(scene)) {}

  Model Run() {
    model_.name = scene_.name;
    model_.duration = scene_.duration;
    FindBeamWelds();
    NumberSlots();
    MakeLinks();
    PlaceAll();
    FillBending();
    FillJoints();
    FillFields();
    FillOutputs();
    FillState();
    CheckConstraints();
    return std::move(model_);
  }

 private:
  struct BeamEnd {
    const data::SceneWeld* weld = nullptr;  // to a body
    int station = -1;                       // slot
  };

  int NodeOfBeam(int beam) const { return static_cast<int>(merged_.list.size()) + beam; }
  int NodeOf(const SceneEnd& end) const {
    if (end.kind == SceneEnd::Kind::kGround) return 0;
    if (end.kind == SceneEnd::Kind::kBody) return merged_.of_body[end.index];
    return NodeOfBeam(end.index);
  }
  // The end's point and axis in its node's frame.
  PlanePose InNode(const SceneEnd& end) const {
    switch (end.kind) {
      case SceneEnd::Kind::kGround:
        return {end.point[0], end.point[1], 0.0};
      case SceneEnd::Kind::kBody:
        return merged_.body_in[end.index] * PlanePose{end.point[0], end.point[1], 0.0};
      case SceneEnd::Kind::kBeamStart:
        return {};
      case SceneEnd::Kind::kBeamEnd:
        return {scene_.beams[end.index].length, 0.0, 0.0};
      case SceneEnd::Kind::kAlongBeam:
        return {end.at * scene_.beams[end.index].length, 0.0, 0.0};
    }
    return {};
  }
  BeamEnd& EndOf(const SceneEnd& end) {
    return beam_ends_[end.index][end.kind == SceneEnd::Kind::kBeamStart ? 0 : 1];
  }
  static const SceneEnd& BodySide(const data::SceneWeld& weld) {
    return IsBeam(weld.inner) ? weld.outer : weld.inner;
  }
  static const SceneEnd& BeamSide(const data::SceneWeld& weld) {
    return IsBeam(weld.inner) ? weld.inner : weld.outer;
  }
  // The body-side end that stands for a beam's end: of a welded end, the body it is welded to.
  SceneEnd Carrier(const SceneEnd& end) {
    if (IsBeam(end) && EndOf(end).weld != nullptr) return BodySide(*EndOf(end).weld);
    return end;
  }

  void FindBeamWelds() {
    beam_ends_.resize(scene_.beams.size());
    for (const data::SceneWeld& weld : scene_.welds) {
      if (JoinsBodies(weld)) continue;
      if (IsBeam(weld.inner) && IsBeam(weld.outer)) {
        throw Error(fmt::format("weld '{}' joins two beams directly", weld.name), weld.where,
                    "put a body between them and weld both to it");
      }
      BeamEnd& end = EndOf(BeamSide(weld));
      if (end.weld != nullptr) {
        throw Error(fmt::format("weld '{}' holds a beam's end that weld '{}' already holds",
                                weld.name, end.weld->name),
                    weld.where, "weld the second body to the first");
      }
      end.weld = &weld;
    }
  }

  void NumberSlots() {
    int next = 0;
    first_segment_.resize(scene_.beams.size());
    for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
      if (beam_ends_[b][0].weld != nullptr) beam_ends_[b][0].station = next++;
      first_segment_[b] = next;
      next += scene_.beams[b].segments;
      if (beam_ends_[b][1].weld != nullptr) beam_ends_[b][1].station = next++;
    }
    Slots& slots = model_.slots;
    slots.beam_count = PaddedSize(next);
    next = slots.beam_count;
    slot_of_composite_.assign(merged_.list.size(), -1);
    for (std::size_t c = 1; c < merged_.list.size(); ++c) slot_of_composite_[c] = next++;
    slots.ground = next++;
    slot_of_composite_[0] = slots.ground;
    slots.count = PaddedSize(next);
    model_.index.n = slots.count;
    slots.mass = slots.inertia = Array(slots.count, 0.0);
    for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
      const data::SceneBeam& beam = scene_.beams[b];
      const double m = beam.mass / beam.segments, l = beam.length / beam.segments;
      for (int k = 0; k < beam.segments; ++k) {
        slots.mass[first_segment_[b] + k] = m;
        slots.inertia[first_segment_[b] + k] = m * l * l / 12.0;
      }
    }
    for (std::size_t c = 1; c < merged_.list.size(); ++c) {
      slots.mass[slot_of_composite_[c]] = merged_.list[c].mass;
      slots.inertia[slot_of_composite_[c]] = merged_.list[c].inertia;
    }
    slots.inverse_mass = slots.inverse_inertia = Array(slots.count, 0.0);
    for (int k = 0; k < slots.count; ++k) {
      if (slots.mass[k] > 0.0) slots.inverse_mass[k] = 1.0 / slots.mass[k];
      if (slots.inertia[k] > 0.0) slots.inverse_inertia[k] = 1.0 / slots.inertia[k];
    }
  }

  void MakeLinks() {
    for (const data::SceneJoint& joint : scene_.joints) {
      Link link;
      link.name = joint.name;
      link.where = joint.where;
      link.revolute = true;
      link.inner = NodeOf(joint.inner);
      link.outer = NodeOf(joint.outer);
      link.inner_in = InNode(joint.inner) * PlanePose{0.0, 0.0, joint.zero_angle};
      link.outer_in = InNode(joint.outer);
      link.sign = joint.sign;
      if (link.inner == link.outer) {
        throw Error(fmt::format("joint '{}' joins a rigid body to itself", joint.name), joint.where,
                    "join two bodies that are not welded together");
      }
      links_.push_back(link);
    }
    for (const data::SceneWeld& weld : scene_.welds) {
      if (JoinsBodies(weld)) continue;
      Link link;
      link.name = weld.name;
      link.where = weld.where;
      link.inner = NodeOf(weld.inner);
      link.outer = NodeOf(weld.outer);
      link.inner_in = InNode(weld.inner) * PlanePose{0.0, 0.0, weld.angle};
      link.outer_in = InNode(weld.outer);
      links_.push_back(link);
    }
  }

  // Takes the pose and velocity that the scene gives to one body or beam; each component may have
  // one, at the node that then is its root.
  void PlaceAll() {
    const int nodes = NodeOfBeam(static_cast<int>(scene_.beams.size()));
    std::vector<PlanePose> pose(nodes), velocity(nodes);
    std::vector<std::string> placed_by(nodes), where(nodes);
    const auto take = [&](int node, const std::string& name, const std::string& at,
                          const std::optional<std::array<double, 3>>& p,
                          const std::optional<std::array<double, 3>>& v, const PlanePose& in) {
      if (!p && !v) return;
      if (!placed_by[node].empty()) {
        throw Error(fmt::format("'{}' and '{}' are welded together and both have a place",
                                placed_by[node], name),
                    at, "keep one");
      }
      placed_by[node] = name;
      where[node] = at;
      if (p) pose[node] = PlanePose{(*p)[0], (*p)[1], (*p)[2]} * in.Inverse();
      if (v) {
        const PlanePose world = pose[node] * in;
        const double dx = pose[node].x - world.x, dy = pose[node].y - world.y;
        velocity[node] = {(*v)[0] - (*v)[2] * dy, (*v)[1] + (*v)[2] * dx, (*v)[2]};
      }
    };
    for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
      const data::SceneBody& body = scene_.bodies[b];
      take(merged_.of_body[b], body.name, body.where, body.pose, body.velocity, merged_.body_in[b]);
    }
    for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
      const data::SceneBeam& beam = scene_.beams[b];
      take(NodeOfBeam(static_cast<int>(b)), beam.name, beam.where, beam.pose, beam.velocity, {});
    }
    std::vector<int> roots{0};
    for (int n = 1; n < nodes; ++n) {
      if (!placed_by[n].empty()) roots.push_back(n);
    }
    for (int n = 1; n < nodes; ++n) roots.push_back(n);
    const Assembly assembly(nodes, links_, roots);
    for (int n = 0; n < nodes; ++n) {
      if (placed_by[n].empty() || assembly.RootOf(n) == n) continue;
      throw Error(fmt::format("the place of '{}' follows from the joints", placed_by[n]), where[n],
                  "remove its pose and velocity, or those of the body that it hangs on");
    }
    std::vector<double> theta(links_.size(), 0.0), rate(links_.size(), 0.0),
        hang(links_.size(), 0.0);
    for (std::size_t j = 0; j < scene_.joints.size(); ++j) {
      theta[j] = scene_.joints[j].theta;
      rate[j] = scene_.joints[j].theta_rate;
      hang[j] = scene_.joints[j].hang_theta;
    }
    start_ = assembly.Place(pose, velocity, theta, rate);
    if (scene_.suspension) hang_ = assembly.Place(pose, velocity, hang, rate);
  }

  void FillBending() {
    Slots& slots = model_.slots;
    model_.bending = Bending(slots.beam_count);
    element_length_.assign(slots.beam_count, 0.0);
    element_names_.assign(slots.beam_count, "");
    for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
      const data::SceneBeam& beam = scene_.beams[b];
      const double l = beam.length / beam.segments;
      const auto add = [&](int e, double length) {
        model_.bending.Set(e, {length, beam.EI, beam.axial_elastic ? beam.EA : 0.0, beam.damping,
                               beam.gradient_form});
        if (!beam.axial_elastic) element_length_[e] = length;
        element_names_[e] = beam.name;
      };
      const int first = first_segment_[b], last = first + beam.segments - 1;
      for (int k = 0; k < 2; ++k) {
        const BeamEnd& end = beam_ends_[b][k];
        if (end.weld == nullptr) continue;
        add(k == 0 ? end.station : last, 0.5 * l);
        AddStation(end, static_cast<int>(b));
      }
      for (int e = first; e < last; ++e) add(e, l);
    }
  }

  void AddStation(const BeamEnd& end, int beam) {
    const SceneEnd& body_end = BodySide(*end.weld);
    const PlanePose in = InNode(body_end);
    Station s;
    s.slot = end.station;
    s.body = slot_of_composite_[NodeOf(body_end)];
    s.px = in.x;
    s.py = in.y;
    s.angle = in.angle + (IsBeam(end.weld->outer) ? end.weld->angle : -end.weld->angle);
    // Whole turns between body and beam are no bending.
    const double turned =
        start_.node[NodeOfBeam(beam)].angle - start_.node[NodeOf(body_end)].angle - s.angle;
    s.angle += 2.0 * M_PI * std::round(turned / (2.0 * M_PI));
    model_.slots.stations.push_back(s);
  }

  // The slot and point of an end. Beam ends that are not welded move with the outer half segment.
  MovingPoint PointOf(const SceneEnd& raw, double* angle) {
    const SceneEnd end = Carrier(raw);
    if (IsBeam(end)) {
      const data::SceneBeam& beam = scene_.beams[end.index];
      const bool start = end.kind == SceneEnd::Kind::kBeamStart;
      const double half = 0.5 * beam.length / beam.segments;
      *angle = 0.0;
      return {first_segment_[end.index] + (start ? 0 : beam.segments - 1), start ? -half : half,
              0.0};
    }
    const PlanePose in = InNode(end);
    *angle = in.angle;
    return {slot_of_composite_[NodeOf(end)], in.x, in.y};
  }

  void FillJoints() {
    JointRows rows;
    for (std::size_t j = 0; j < scene_.joints.size(); ++j) {
      const data::SceneJoint& joint = scene_.joints[j];
      double inner_angle = 0.0, outer_angle = 0.0;
      const MovingPoint inner = PointOf(joint.inner, &inner_angle);
      const MovingPoint outer = PointOf(joint.outer, &outer_angle);
      if (inner.slot == outer.slot) {
        throw Error(fmt::format("joint '{}' joins a rigid body to itself", joint.name), joint.where,
                    "join two bodies that are not welded together");
      }
      rows.pins.push_back({inner.slot, outer.slot, inner.px, inner.py, outer.px, outer.py, joint.name});
      Model::Joint out;
      out.name = joint.name;
      out.pin = inner;
      Hinge& hinge = out.hinge;
      hinge.inner = inner.slot;
      hinge.outer = outer.slot;
      hinge.sign = joint.sign;
      // The angles at the start are known to be start_.theta; this also settles whole turns.
      hinge.zero = SlotAngle(joint.outer) - SlotAngle(joint.inner) - joint.sign * start_.theta[j];
      const bool moment = joint.spring || joint.latch;
      if (moment && (IsBeam(Carrier(joint.inner)) || IsBeam(Carrier(joint.outer)))) {
        throw Error(
            fmt::format("joint '{}' turns a beam's own end with a spring or latch", joint.name),
            joint.where, "weld a body (a joint half) to the beam's end and join that");
      }
      if (joint.spring) {
        out.spring = model_.springs.count();
        model_.springs.Add(hinge, joint.spring->stiffness, joint.spring->preload);
      }
      if (joint.latch) {
        const data::SceneContact& c = scene_.contacts[joint.latch->contact];
        out.latch = model_.latches.count();
        model_.latches.Add(hinge, {joint.latch->theta_a, joint.latch->theta_b, joint.latch->lever,
                                   c.K, c.C, c.Q, c.epsilon, c.never_pulls});
        LatchMode mode;
        mode.latched = start_.theta[j] < joint.latch->theta_a;
        mode.upper_contact = mode.latched && start_.theta[j] > joint.latch->theta_a;
        mode.lower_contact = start_.theta[j] < -joint.latch->theta_b;
        model_.initial_modes.push_back(mode);
      }
      model_.joints.push_back(out);
    }
    model_.constraints = Constraints(model_.slots, element_length_, std::move(rows), element_names_);
  }

  double SlotAngle(const SceneEnd& raw) { return start_.node[NodeOf(Carrier(raw))].angle; }

  void FillFields() {
    if (scene_.gravity) {
      model_.gravity = Gravity(model_.slots.mass, scene_.gravity->acceleration[0],
                               scene_.gravity->acceleration[1]);
    }
    if (!scene_.suspension) return;
    const double per_mass = scene_.suspension->gravity / scene_.suspension->length;
    model_.suspension = Suspension(model_.slots.count);
    for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
      const data::SceneBeam& beam = scene_.beams[b];
      const double l = beam.length / beam.segments;
      const PlanePose& at = hang_.node[NodeOfBeam(static_cast<int>(b))];
      for (int k = 0; k < beam.segments; ++k) {
        const PlanePose centre = at * PlanePose{(k + 0.5) * l, 0.0, 0.0};
        const int slot = first_segment_[b] + k;
        model_.suspension.Set(slot, per_mass * model_.slots.mass[slot], centre.x, centre.y, 0.0,
                              0.0);
      }
    }
    for (std::size_t c = 1; c < merged_.list.size(); ++c) {
      double kappa = 0.0;
      for (const int b : merged_.list[c].members) {
        const PlanePose& in = merged_.body_in[b];
        kappa += per_mass * scene_.bodies[b].mass * (in.x * in.x + in.y * in.y);
      }
      const int slot = slot_of_composite_[c];
      const PlanePose& at = hang_.node[c];
      model_.suspension.Set(slot, per_mass * model_.slots.mass[slot], at.x, at.y, kappa, at.angle);
    }
  }

  void FillOutputs() {
    for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
      const PlanePose& in = merged_.body_in[b];
      model_.bodies.push_back(
          {scene_.bodies[b].name, {slot_of_composite_[merged_.of_body[b]], in.x, in.y}, in.angle});
    }
    for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
      const data::SceneBeam& beam = scene_.beams[b];
      model_.beams.push_back(
          {beam.name, first_segment_[b], beam.segments, beam.length / beam.segments});
      model_.length_scale = std::max(model_.length_scale, beam.length);
    }
    for (const data::SceneMark& mark : scene_.marks) {
      double angle = 0.0;
      model_.marks.push_back({mark.name, PointOf(mark.on, &angle)});
    }
    if (scene_.beams.empty()) {
      for (const Link& link : links_) {
        for (const PlanePose& p : {link.inner_in, link.outer_in}) {
          model_.length_scale = std::max(model_.length_scale, std::hypot(p.x, p.y));
        }
      }
      if (!(model_.length_scale > 0.0)) model_.length_scale = 1.0;
    }
  }

  void FillState() {
    const StateIndex& index = model_.index;
    model_.initial_state.assign(index.size(), 0.0);
    const auto set = [&](int slot, const PlanePose& node, const PlanePose& velocity, double px) {
      const PlanePose at = node * PlanePose{px, 0.0, 0.0};
      model_.initial_state[index.x(slot)] = at.x;
      model_.initial_state[index.y(slot)] = at.y;
      model_.initial_state[index.theta(slot)] = at.angle;
      model_.initial_state[index.vx(slot)] = velocity.x - velocity.angle * (at.y - node.y);
      model_.initial_state[index.vy(slot)] = velocity.y + velocity.angle * (at.x - node.x);
      model_.initial_state[index.omega(slot)] = velocity.angle;
    };
    for (std::size_t c = 1; c < merged_.list.size(); ++c) {
      set(slot_of_composite_[c], start_.node[c], start_.velocity[c], 0.0);
    }
    for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
      const int node = NodeOfBeam(static_cast<int>(b));
      const double l = scene_.beams[b].length / scene_.beams[b].segments;
      for (int k = 0; k < scene_.beams[b].segments; ++k) {
        set(first_segment_[b] + k, start_.node[node], start_.velocity[node], (k + 0.5) * l);
      }
    }
  }

  // Independent constraints have a definite Schur complement; starting velocities are made to fit.
  void CheckConstraints() {
    if (model_.constraints.count() == 0) return;
    Dynamics dynamics(model_);
    std::vector<double> rate(model_.initial_state.size());
    dynamics.RightSide(0.0, model_.initial_state.data(), rate.data());
    std::string name;
    const double pivot = dynamics.SmallestPivot(&name);
    if (!(pivot > kRedundant)) {
      throw Error(fmt::format("the constraints are not independent (found at '{}')", name),
                  scene_.path, "remove a joint or weld that repeats what others already hold");
    }
    dynamics.Project(0.0, model_.initial_state.data());
  }

  const data::Scene& scene_;
  Composites merged_;
  Model model_;
  std::vector<std::array<BeamEnd, 2>> beam_ends_;
  std::vector<int> first_segment_;  // slot by beam
  std::vector<int> slot_of_composite_;
  std::vector<Link> links_;
  Placement start_, hang_;
  std::vector<double> element_length_;  // of the longitudinal constraints
  std::vector<std::string> element_names_;
};

}  // namespace

Model Compile(const data::Scene& scene) { return Compiler(scene).Run(); }

}  // namespace unfurl::sim
