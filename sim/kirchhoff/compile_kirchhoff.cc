// Smooth beams: what is attached to them, their bodies, and welds that stay constraints.
#include <fmt/format.h>

#include <cmath>

#include "base/error.h"
#include "sim/model/compiler.h"
#include "sim/model/end_bodies.h"

namespace unfurl::sim {

using CompileKirchhoffKind = data::SceneEnd::Kind;

bool Compiler::IsSmooth(int beam) const {
  return scene_.beams[beam].model == data::BeamModel::kKirchhoff;
}

double Compiler::CentreOfBody(int b, int k) const {
  const data::SceneBeam& beam = scene_.beams[b];
  if (IsSmooth(b)) return beam.section.Centre() * beam.length;
  return (k + 0.5) * (beam.length / beam.segments);
}

bool Compiler::OnSmooth(const data::SceneEnd& end) const {
  return OnBeam(end) && IsSmooth(end.index);
}

Compiler::Attached& Compiler::AttachmentAt(const data::SceneEnd& end, bool loaded) {
  const double at = PlaceOn(end);
  std::vector<Attached>& list = smooth_[end.index].attached;
  KirchhoffShapes::Ends& ends = smooth_[end.index].ends;
  ends.force_at_start =
      ends.force_at_start || (loaded && end.kind == CompileKirchhoffKind::kBeamStart);
  ends.force_at_end = ends.force_at_end || (loaded && end.kind == CompileKirchhoffKind::kBeamEnd);
  for (Attached& a : list) {
    if (a.at == at) return a;
  }
  list.push_back({at, -1, -1});
  return list.back();
}

void Compiler::FindAttachments() {
  smooth_.resize(scene_.beams.size());
  AttachWelds();
  AttachJoints();
  AttachLoads();
  AttachMarks();
  CheckSmoothBeams();
}

// An end at which a moment acts bends there too.
void Compiler::BendAt(const data::SceneEnd& end) {
  if (end.kind == CompileKirchhoffKind::kBeamStart) smooth_[end.index].ends.moment_at_start = true;
  if (end.kind == CompileKirchhoffKind::kBeamEnd) smooth_[end.index].ends.moment_at_end = true;
}

// A body that one weld alone joins to a beam becomes part of that beam, at its attachment: no
// constraint, and no acceleration of a small body to be found apart. Other welds are constraints.
void Compiler::AttachWelds() {
  std::vector<int> welds(merged_.list.size(), 0);
  for (const data::SceneWeld& weld : scene_.welds) {
    if (JoinsBodies(weld)) continue;
    for (const data::SceneEnd* end : {&weld.inner, &weld.outer}) {
      if (!OnBeam(*end)) ++welds[NodeOf(*end)];
    }
  }
  for (const data::SceneWeld& weld : scene_.welds) {
    if (JoinsBodies(weld)) continue;
    bool rows = false;
    for (const data::SceneEnd* end : {&weld.inner, &weld.outer}) {
      if (!OnSmooth(*end)) continue;
      BendAt(*end);
      const data::SceneEnd& other = end == &weld.inner ? weld.outer : weld.inner;
      Attached& attached = AttachmentAt(*end);
      const int node = OnBeam(other) ? 0 : NodeOf(other);
      if (node != 0 && welds[node] == 1) {
        attached.composite = node;
      } else {
        rows = true;
      }
    }
    if (rows) weld_rows_.push_back(&weld);
  }
}

void Compiler::AttachJoints() {
  for (const data::SceneJoint& joint : scene_.joints) {
    for (const data::SceneEnd* raw : {&joint.inner, &joint.outer}) {
      const data::SceneEnd end = Carrier(*raw);
      if (!OnSmooth(end)) continue;
      AttachmentAt(end);
      if (CarriesMoment(joint)) BendAt(end);
    }
  }
}

void Compiler::AttachLoads() {
  for (const data::SceneLinearSpring& spring : scene_.linear_springs) {
    for (const data::SceneEnd* end : {&spring.a, &spring.b}) {
      if (OnSmooth(Carrier(*end))) AttachmentAt(Carrier(*end));
    }
  }
  for (const data::SceneForce& force : scene_.forces) {
    const data::SceneEnd end = Carrier(force.on);
    if (force.kind == data::SceneForce::Kind::kPerLength || !OnSmooth(end)) continue;
    AttachmentAt(end);
    if (force.kind == data::SceneForce::Kind::kTorque) BendAt(end);
  }
}

// A watched mark needs its motion in the state; other marks are worked out when they are sampled.
void Compiler::AttachMarks() {
  for (const data::SceneMark& mark : scene_.marks) {
    const data::SceneEnd end = Carrier(mark.on);
    if (!OnSmooth(end)) continue;
    for (const data::SceneWatch& watch : scene_.watches) {
      if (watch.quantity.rfind(mark.name + ".", 0) == 0) AttachmentAt(end, false);
    }
  }
}

void Compiler::CheckSmoothBeams() const {
  for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
    const data::SceneBeam& beam = scene_.beams[b];
    if (!IsSmooth(static_cast<int>(b))) continue;
    if (beam.order < 1 || beam.order > KirchhoffShapes::kMostModes) {
      throw Error(fmt::format("beam '{}' has order {}", beam.name, beam.order), beam.where,
                  fmt::format("use 1 to {}", KirchhoffShapes::kMostModes));
    }
  }
}

int Compiler::NumberSmoothBodies(int next) {
  RigidBodies& bodies = model_.rigid_bodies;
  for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
    if (!IsSmooth(static_cast<int>(b))) continue;
    first_segment_[b] = next++;
    const int order = scene_.beams[b].order;
    const int strains = scene_.beams[b].axial_elastic ? KirchhoffShapes::StretchesFor(order) : 0;
    const int shapes = order + smooth_[b].ends.count() + strains;
    for (int k = 0; k < shapes; k += 3) bodies.amplitudes.push_back(next++);
    bodies.attached.emplace_back();
    for (Attached& a : smooth_[b].attached) {
      a.body = a.composite < 0 ? next++ : body_of_composite_[a.composite];
      bodies.attached.back().push_back(a.body);
    }
  }
  return next;
}

void Compiler::FillSmooth() {
  for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
    if (!IsSmooth(static_cast<int>(b))) continue;
    const data::SceneBeam& beam = scene_.beams[b];
    const PlanePose& pose = start_.node[NodeOfBeam(static_cast<int>(b))];
    std::vector<KirchhoffRod::Attachment> attachments;
    KirchhoffBeams::Beam out;
    for (const Attached& a : smooth_[b].attached) {
      KirchhoffRod::Attachment attachment;
      attachment.at = a.at;
      if (a.composite >= 0) {
        const PlanePose& body = start_.node[a.composite];
        const PlanePose in = (pose * PlanePose{a.at * beam.length, 0.0, 0.0}).Inverse() * body;
        attachment.px = in.x;
        attachment.py = in.y;
        attachment.angle = body.angle - pose.angle;
        attachment.mass = merged_.list[a.composite].mass;
        attachment.inertia = merged_.list[a.composite].inertia;
      }
      attachments.push_back(attachment);
      out.attached.push_back(a.body);
    }
    KirchhoffRod::Strings strings;
    if (scene_.suspension) {
      strings.gravity_per_length = scene_.suspension->gravity / scene_.suspension->length;
      strings.angle = hang_.node[NodeOfBeam(static_cast<int>(b))].angle;
    }
    out.rod = KirchhoffRod({beam.length, beam.mass, beam.EI, beam.damping, beam.order,
                            smooth_[b].ends, beam.section, beam.axial_elastic ? beam.EA : 0.0},
                           std::move(attachments), strings);
    out.root = first_segment_[b];
    out.name = beam.name;
    smooth_[b].index = model_.kirchhoff.count();
    model_.kirchhoff.Add(std::move(out));
  }
}

void Compiler::AddWeldRows(JointRows* rows) {
  const auto point = [&](const data::SceneEnd& end) {
    if (OnSmooth(end)) return MovingPoint{AttachmentAt(end).body, 0.0, 0.0};
    const PlanePose in = InNode(end);
    return MovingPoint{body_of_composite_[NodeOf(end)], in.x, in.y};
  };
  for (const data::SceneWeld* weld : weld_rows_) {
    const MovingPoint i = point(weld->inner), o = point(weld->outer);
    rows->pins.push_back({i.body, o.body, i.px, i.py, o.px, o.py, weld->name});
    const double zero =
        start_.node[NodeOf(weld->outer)].angle - start_.node[NodeOf(weld->inner)].angle;
    rows->angles.push_back({i.body, o.body, zero, 1.0, data::TimeFunction(), weld->name});
  }
}

MovingPoint Compiler::SmoothPoint(const data::SceneEnd& end) {
  const double at = PlaceOn(end);
  for (const Attached& a : smooth_[end.index].attached) {
    if (a.at == at && a.composite < 0) return {a.body, 0.0, 0.0};
  }
  MovingPoint point{first_segment_[end.index], 0.0, 0.0};
  point.watched = model_.kirchhoff.Watch(smooth_[end.index].index, at);
  return point;
}

}  // namespace unfurl::sim
