// The order of work, bodies, outputs and the state at the start.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/text.h"
#include "sim/constraints/redundancy.h"
#include "sim/dynamics/dynamics.h"
#include "sim/model/compiler.h"
#include "sim/model/end_bodies.h"

namespace unfurl::sim {
namespace {

// A pivot of the Schur complement this small beside its diagonal entry means redundant constraints.
constexpr double kRedundant = 1e-11;
// Time scale, of the scene's duration. It only weighs the errors of slow velocities: an error of
// velocity that lasted the whole run would move a body by five times the error of its position.
constexpr double kPace = 0.2;

}  // namespace

using CompileKind = data::SceneEnd::Kind;

bool OnBeam(const data::SceneEnd& end) {
  return end.kind != CompileKind::kGround && end.kind != CompileKind::kBody;
}
double PlaceOn(const data::SceneEnd& end) {
  return end.kind == CompileKind::kBeamStart ? 0.0
         : end.kind == CompileKind::kBeamEnd ? 1.0
                                             : end.at;
}
const data::SceneEnd& BodySide(const data::SceneWeld& weld) {
  return IsBeamEnd(weld.inner) ? weld.outer : weld.inner;
}
double BeamAgainstBody(const data::SceneWeld& weld) {
  return IsBeamEnd(weld.outer) ? weld.angle : -weld.angle;
}
const data::SceneEnd& BeamSide(const data::SceneWeld& weld) {
  return IsBeamEnd(weld.inner) ? weld.inner : weld.outer;
}

Compiler::Compiler(const data::Scene& scene)
    : scene_(WithEndBodies(scene)), merged_(MergeWeldedBodies(scene_)) {}

Model Compiler::Run() {
  model_.name = scene_.name;
  model_.duration = scene_.duration;
  model_.time_scale = kPace * scene_.duration;
  FindBeamWelds();
  FindAttachments();
  NumberRigidBodies();
  MakeLinks();
  PlaceAll();
  FillBending();
  FillSmooth();
  FillJoints();
  FillLinearSprings();
  FillForces();
  FillFields();
  FillOutputs();
  FillState();
  CheckConstraints();
  WarnOfLooseParts();
  CheckStops();
  WarnOfIdleKeys();
  return std::move(model_);
}

int Compiler::NodeOf(const data::SceneEnd& end) const {
  if (end.kind == CompileKind::kGround) return 0;
  if (end.kind == CompileKind::kBody) return merged_.of_body[end.index];
  return NodeOfBeam(end.index);
}

PlanePose Compiler::InNode(const data::SceneEnd& end) const {
  switch (end.kind) {
    case CompileKind::kGround:
      return {end.point[0], end.point[1], 0.0};
    case CompileKind::kBody:
      return merged_.body_in[end.index] * PlanePose{end.point[0], end.point[1], 0.0};
    case CompileKind::kBeamStart:
      return {};
    case CompileKind::kBeamEnd:
      return {scene_.beams[end.index].length, 0.0, 0.0};
    case CompileKind::kAlongBeam:
      return {end.at * scene_.beams[end.index].length, 0.0, 0.0};
  }
  return {};
}

Compiler::BeamEnd& Compiler::EndOf(const data::SceneEnd& end) {
  return beam_ends_[end.index][end.kind == CompileKind::kBeamStart ? 0 : 1];
}

data::SceneEnd Compiler::Carrier(const data::SceneEnd& end) {
  if (IsBeamEnd(end) && EndOf(end).weld != nullptr) return BodySide(*EndOf(end).weld);
  return end;
}

double Compiler::BodyAngle(const data::SceneEnd& end) {
  return start_.node[NodeOf(Carrier(end))].angle;
}

MovingPoint Compiler::PointOf(const data::SceneEnd& raw, double* angle) {
  const data::SceneEnd end = Carrier(raw);
  *angle = 0.0;
  if (!OnBeam(end)) {
    const PlanePose in = InNode(end);
    *angle = in.angle + (IsBeamEnd(raw) ? BeamAgainstBody(*EndOf(raw).weld) : 0.0);
    return {body_of_composite_[NodeOf(end)], in.x, in.y};
  }
  if (IsSmooth(end.index)) return SmoothPoint(end);
  const data::SceneBeam& beam = scene_.beams[end.index];
  const double place = PlaceOn(end) * beam.segments;  // in segments
  const int k = std::clamp(static_cast<int>(std::floor(place)), 0, beam.segments - 1);
  const double l = beam.length / beam.segments;
  const double off = place - k - 0.5;  // from the segment's middle
  MovingPoint point{first_segment_[end.index] + k, off * l, 0.0};
  const int side = off < 0.0 ? -1 : 1;
  if (k + side >= 0 && k + side < beam.segments) {
    point.other_body = point.body + side;
    point.other_px = (off - side) * l;
    point.other_share = std::fabs(off);
  }
  return point;
}

void Compiler::FindBeamWelds() {
  beam_ends_.resize(scene_.beams.size());
  for (const data::SceneWeld& weld : scene_.welds) {
    if (JoinsBodies(weld)) continue;
    if (IsBeamEnd(weld.inner) && IsBeamEnd(weld.outer)) continue;  // two smooth beams
    BeamEnd& end = EndOf(BeamSide(weld));
    if (end.weld != nullptr) {
      throw Error(fmt::format("weld '{}' holds a beam's end that weld '{}' already holds",
                              weld.name, end.weld->name),
                  weld.where, "weld the second body to the first");
    }
    end.weld = &weld;
  }
}

void Compiler::NumberRigidBodies() {
  int next = 0;
  first_segment_.resize(scene_.beams.size());
  for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
    if (IsSmooth(static_cast<int>(b))) continue;
    if (beam_ends_[b][0].weld != nullptr) beam_ends_[b][0].station = next++;
    first_segment_[b] = next;
    next += scene_.beams[b].segments;
    if (beam_ends_[b][1].weld != nullptr) beam_ends_[b][1].station = next++;
  }
  RigidBodies& bodies = model_.rigid_bodies;
  bodies.beam_count = PaddedSize(next);
  next = bodies.beam_count;
  body_of_composite_.assign(merged_.list.size(), -1);
  for (std::size_t c = 1; c < merged_.list.size(); ++c) body_of_composite_[c] = next++;
  next = NumberSmoothBodies(next);
  bodies.ground = next++;
  body_of_composite_[0] = bodies.ground;
  bodies.count = PaddedSize(next);
  model_.index.n = bodies.count;
  bodies.mass = bodies.inertia = Array(bodies.count, 0.0);
  for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
    const data::SceneBeam& beam = scene_.beams[b];
    if (IsSmooth(static_cast<int>(b))) {
      bodies.mass[first_segment_[b]] = beam.mass;  // its turning is the beam's own
      continue;
    }
    const double l = beam.length / beam.segments;
    for (int k = 0; k < beam.segments; ++k) {
      const double m = ShareOf(beam, k);
      bodies.mass[first_segment_[b] + k] = SegmentMass(beam, k);
      bodies.inertia[first_segment_[b] + k] = m * l * l / 12.0;
    }
  }
  for (std::size_t c = 1; c < merged_.list.size(); ++c) {
    bodies.mass[body_of_composite_[c]] = merged_.list[c].mass;
    bodies.inertia[body_of_composite_[c]] = merged_.list[c].inertia;
  }
  bodies.inverse_mass = bodies.inverse_inertia = Array(bodies.count, 0.0);
  for (int k = 0; k < bodies.count; ++k) {
    if (bodies.mass[k] > 0.0) bodies.inverse_mass[k] = 1.0 / bodies.mass[k];
    if (bodies.inertia[k] > 0.0) bodies.inverse_inertia[k] = 1.0 / bodies.inertia[k];
  }
  for (const std::vector<int>& attached : bodies.attached) {
    for (const int body : attached) bodies.inverse_mass[body] = bodies.inverse_inertia[body] = 0.0;
  }
}

void Compiler::FillOutputs() {
  for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
    const PlanePose& in = merged_.body_in[b];
    const int body = body_of_composite_[merged_.of_body[b]];
    if (scene_.bodies[b].implied) {
      model_.end_bodies.push_back({body, scene_.bodies[b].name});
    } else {
      model_.bodies.push_back({scene_.bodies[b].name, {body, in.x, in.y}, in.angle});
    }
  }
  for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
    const data::SceneBeam& beam = scene_.beams[b];
    if (IsSmooth(static_cast<int>(b))) {
      model_.beams.push_back({beam.name, first_segment_[b], 1, beam.length, smooth_[b].index});
    } else {
      model_.beams.push_back(
          {beam.name, first_segment_[b], beam.segments, beam.length / beam.segments});
      for (int k = 0; k < 2; ++k) {
        const BeamEnd& end = beam_ends_[b][k];
        if (end.weld != nullptr) model_.beams.back().stations[k] = end.station;
      }
      for (int k = 0; k < beam.segments; ++k) model_.beams.back().mass.push_back(ShareOf(beam, k));
    }
    constexpr double kMiddle = 0.5;  // of the length [-]: where BEAM.axial_force is told
    model_.beams.back().EI = beam.EI * beam.section.Bending(kMiddle);
    if (beam.axial_elastic) model_.beams.back().EA = beam.EA * beam.section.Area(kMiddle);
    model_.length_scale = std::max(model_.length_scale, beam.length);
  }
  for (const data::SceneMark& mark : scene_.marks) {
    double angle = 0.0;
    model_.marks.push_back({mark.name, PointOf(mark.on, &angle)});
  }
  FillSensors();
  if (scene_.beams.empty()) {
    for (const Link& link : links_) {
      for (const PlanePose& p : {link.inner_in, link.outer_in}) {
        model_.length_scale = std::max(model_.length_scale, std::hypot(p.x, p.y));
      }
    }
    if (!(model_.length_scale > 0.0)) model_.length_scale = ReachOfBodies();
  }
}

void Compiler::FillSensors() {
  for (const data::SceneSensor& from : scene_.sensors) {
    Model::Sensor sensor{from.name, from.kind, {}};
    sensor.point = PointOf(from.on, &sensor.angle);
    sensor.angle += from.axis;
    sensor.feels_gravity = from.feels_gravity;
    sensor.height = from.height;
    if (from.on.kind != data::SceneEnd::Kind::kBody) {
      sensor.beam = from.on.index;
      const double part = from.on.kind == data::SceneEnd::Kind::kBeamStart ? 0.0
                          : from.on.kind == data::SceneEnd::Kind::kBeamEnd ? 1.0
                                                                           : from.on.at;
      sensor.place = part * scene_.beams[from.on.index].length;
    }
    model_.sensors.push_back(std::move(sensor));
  }
  if (scene_.gravity) {
    for (int k = 0; k < 2; ++k) model_.field[k] = scene_.gravity->acceleration[k];
  }
}

// How far bodies without joints or beams stand apart or go, and what springs span.
double Compiler::ReachOfBodies() const {
  double reach = 0.0;
  for (const PlanePose& at : start_.node) {
    reach = std::max(reach, std::hypot(at.x - start_.node[0].x, at.y - start_.node[0].y));
  }
  for (const PlanePose& v : start_.velocity) {
    reach = std::max(reach, scene_.duration * std::hypot(v.x, v.y));
  }
  for (const data::SceneJoint& joint : scene_.joints) {
    reach =
        std::max({reach, std::fabs(joint.travel), scene_.duration * std::fabs(joint.travel_rate)});
    if (joint.kind == data::SceneJoint::Kind::kRevolute) continue;
    if (joint.spring) reach = std::max(reach, std::fabs(joint.spring->preload));
    if (!joint.drive) continue;
    constexpr int kLooks = 64;  // at a driven travel
    const data::TimeFunction& given = joint.drive->function;
    const data::TimeFunction f =
        joint.drive->by_rate ? given.Integral(0.0, scene_.duration) : given;
    for (int k = 1; k <= kLooks; ++k) {
      reach = std::max(reach, std::fabs(f.Value(k * scene_.duration / kLooks) - f.Value(0.0)));
    }
  }
  for (const data::SceneLinearSpring& spring : scene_.linear_springs) {
    reach = std::max({reach, spring.free_length.value_or(0.0),
                      std::hypot(spring.a.point[0], spring.a.point[1]),
                      std::hypot(spring.b.point[0], spring.b.point[1])});
  }
  return reach > 0.0 ? reach : 1.0;  // nothing in the scene has a length
}

void Compiler::FillState() {
  const StateIndex& index = model_.index;
  model_.initial_state.assign(index.size(), 0.0);
  const auto set = [&](int body, const PlanePose& node, const PlanePose& velocity, double px) {
    const PlanePose at = node * PlanePose{px, 0.0, 0.0};
    model_.initial_state[index.x(body)] = at.x;
    model_.initial_state[index.y(body)] = at.y;
    model_.initial_state[index.theta(body)] = at.angle;
    model_.initial_state[index.vx(body)] = velocity.x - velocity.angle * (at.y - node.y);
    model_.initial_state[index.vy(body)] = velocity.y + velocity.angle * (at.x - node.x);
    model_.initial_state[index.omega(body)] = velocity.angle;
  };
  for (std::size_t c = 1; c < merged_.list.size(); ++c) {
    set(body_of_composite_[c], start_.node[c], start_.velocity[c], 0.0);
  }
  for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
    const int node = NodeOfBeam(static_cast<int>(b));
    const int segments = IsSmooth(static_cast<int>(b)) ? 1 : scene_.beams[b].segments;
    for (int k = 0; k < segments; ++k) {
      set(first_segment_[b] + k, start_.node[node], start_.velocity[node],
          CentreOfBody(static_cast<int>(b), k));
    }
  }
}

// A drive that takes part in a redundancy prescribes what is not free to be prescribed.
void Compiler::RefuseDrivesThatFight(std::size_t redundant, const std::string& which) const {
  const Constraints& all = model_.constraints;
  std::vector<int> drives;
  std::vector<std::string> names;
  for (int k = 0; k < all.joints().rows(); ++k) {
    if (!all.joints().IsDrive(k)) continue;
    drives.push_back(all.first_joint_row() + k);
    names.push_back("'" + all.joints().NameOf(k) + "'");
  }
  if (drives.empty()) return;
  Model passive = model_;
  passive.constraints =
      Constraints(model_.rigid_bodies, longitudinal_, all.joints(), element_names_, drives);
  if (FindRedundancy(passive).rows.size() == redundant) return;
  throw Error(
      fmt::format(
          "the drives of {} conflict with other constraints, or duplicate them (found at {})",
          JoinWords(names), which),
      scene_.path, "remove a drive, or a joint that leaves it no freedom");
}

// A straight beam of fixed length between two fixed ends cannot move at all, and its tension is not
// determined.
std::string Compiler::WhereLengthsAreKept() const {
  const bool kept = std::any_of(model_.beams.begin(), model_.beams.end(),
                                [](const Model::Beam& beam) { return !(beam.EA > 0.0); });
  return kept ? ", or let beams that are held at both ends stretch: axial = \"elastic\"" : "";
}

// Independent constraints have a definite Schur complement; starting velocities are made to fit.
void Compiler::CheckConstraints() {
  if (model_.constraints.count() == 0) return;
  const Redundancy redundancy = FindRedundancy(model_);
  if (!redundancy.rows.empty()) {
    std::vector<std::string> names;
    for (const int row : redundancy.rows) {
      const std::string name = "'" + model_.constraints.NameOf(row) + "'";
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
    const std::string which = JoinWords(names);
    RefuseDrivesThatFight(redundancy.rows.size(), which);
    if (redundancy.singular) {
      throw Error(
          fmt::format("the constraints depend on one another at the start (found at {})", which),
          scene_.path, "start a little away from this singular state" + WhereLengthsAreKept());
    }
    model_.warnings.push_back(fmt::format(
        "{} of the constraints of {} {} from the others and {} left out; how the joints of the "
        "loop share its loads is not determined",
        redundancy.rows.size(), which, redundancy.rows.size() == 1 ? "follows" : "follow",
        redundancy.rows.size() == 1 ? "is" : "are"));
    model_.constraints = Constraints(model_.rigid_bodies, longitudinal_,
                                     model_.constraints.joints(), element_names_, redundancy.rows);
  }
  model_.constraints.SetArm(model_.length_scale);
  Dynamics dynamics(model_);
  std::vector<double> rate(model_.initial_state.size());
  dynamics.RightSide(0.0, model_.initial_state.data(), rate.data());
  std::string name;
  const double pivot = dynamics.SmallestPivot(&name);
  if (!(pivot > kRedundant) && redundancy.rows.empty()) {
    throw Error(fmt::format("a body at '{}' has too little mass or inertia beside the others: its "
                            "motion is lost in rounding",
                            name),
                scene_.path, "give each body the inertia that its size gives it");
  }
  if (!(pivot > kRedundant)) {
    throw Error(
        fmt::format("the constraints are not independent (found at '{}')", name), scene_.path,
        (model_.constraints.driven() ? "remove a joint, weld or drive that duplicates other "
                                       "constraints or conflicts with them"
                                     : "remove a joint or weld that duplicates other constraints") +
            WhereLengthsAreKept());
  }
  dynamics.Project(0.0, model_.initial_state.data());
  dynamics.Update(0.0, model_.initial_state.data());
}

Model Compile(const data::Scene& scene) {
  Model model = Compiler(scene).Run();
  model.watches = Watches(scene, model);
  return model;
}

}  // namespace unfurl::sim
