#include "sim/model/end_bodies.h"

#include <map>
#include <set>
#include <utility>

#include "sim/model/composites.h"

namespace unfurl::sim {
namespace {

using data::SceneEnd;
using EndBodiesKind = SceneEnd::Kind;

constexpr double kMassPart = 0.25;    // of a segment's mass
constexpr double kInertiaPart = 0.5;  // of a segment's inertia

class EndBodies {
 public:
  explicit EndBodies(const data::Scene& scene) : scene_(scene) {
    for (const data::SceneWeld& weld : scene.welds) {
      for (const SceneEnd* end : {&weld.inner, &weld.outer}) {
        const SceneEnd& other = end == &weld.inner ? weld.outer : weld.inner;
        if (IsBeamEnd(*end) && !IsBeamEnd(other)) welded_.insert(KeyOf(*end));
      }
    }
  }

  data::Scene Run() {
    const std::size_t welds = scene_.welds.size();  // BodyAt adds to them
    for (std::size_t w = 0; w < welds; ++w) JoinBeams(w);
    for (data::SceneJoint& joint : scene_.joints) {
      if (!CarriesMoment(joint)) continue;
      TakeMoments(&joint.inner);
      TakeMoments(&joint.outer);
    }
    for (data::SceneForce& force : scene_.forces) {
      if (force.kind == data::SceneForce::Kind::kTorque) TakeMoments(&force.on);
    }
    return std::move(scene_);
  }

 private:
  // Two beams welded end to end: the first one's end body carries the second beam too, at the
  // weld's angle.
  void JoinBeams(std::size_t w) {
    SceneEnd inner = scene_.welds[w].inner, outer = scene_.welds[w].outer;
    if (!IsBeamEnd(inner) || !IsBeamEnd(outer)) return;
    if (Segmented(inner)) {
      inner = BodyAt(inner);
      if (Segmented(outer)) GiveUpMass(outer, &scene_.bodies[inner.index]);
    } else if (Segmented(outer)) {
      outer = BodyAt(outer);
    }
    scene_.welds[w].inner = inner;
    scene_.welds[w].outer = outer;
  }

  // A moment on the end of a segmented beam needs a body there, unless one is welded to it.
  void TakeMoments(SceneEnd* end) {
    if (IsBeamEnd(*end) && Segmented(*end) && !welded_.contains(KeyOf(*end))) *end = BodyAt(*end);
  }

  static std::pair<int, bool> KeyOf(const SceneEnd& end) {
    return {end.index, end.kind == EndBodiesKind::kBeamStart};
  }
  bool Segmented(const SceneEnd& end) const {
    return scene_.beams[end.index].model == data::BeamModel::kSegments;
  }

  void GiveUpMass(const SceneEnd& end, data::SceneBody* body) {
    data::SceneBeam& beam = scene_.beams[end.index];
    bool& carried = beam.carried_ends[end.kind == EndBodiesKind::kBeamStart ? 0 : 1];
    if (carried) return;
    carried = true;
    const double l = beam.length / beam.segments;
    const double m = ShareOf(beam, end.kind == EndBodiesKind::kBeamStart ? 0 : beam.segments - 1);
    body->mass += kMassPart * m;
    body->inertia += kInertiaPart * m * l * l / 12.0;
  }

  // The body of a beam's end; made when first asked for.
  SceneEnd BodyAt(const SceneEnd& end) {
    const bool start = end.kind == EndBodiesKind::kBeamStart;
    SceneEnd at;
    at.kind = EndBodiesKind::kBody;
    if (const auto made = made_.find(KeyOf(end)); made != made_.end()) {
      at.index = made->second;
      return at;
    }
    const data::SceneBeam& beam = scene_.beams[end.index];
    data::SceneBody body;
    body.name = beam.name + (start ? ".start" : ".end");
    body.implied = true;
    body.where = beam.where;
    GiveUpMass(end, &body);
    at.index = static_cast<int>(scene_.bodies.size());
    made_[KeyOf(end)] = at.index;
    scene_.bodies.push_back(body);
    data::SceneWeld weld;
    weld.name = body.name;
    weld.inner = at;
    weld.outer = end;
    weld.where = beam.where;
    scene_.welds.push_back(weld);
    return at;
  }

  data::Scene scene_;
  std::set<std::pair<int, bool>> welded_;     // ends that a body of the scene holds
  std::map<std::pair<int, bool>, int> made_;  // body by end
};

}  // namespace

bool CarriesMoment(const data::SceneJoint& joint) {
  if (joint.kind == data::SceneJoint::Kind::kSlider) return true;
  if (joint.kind == data::SceneJoint::Kind::kPinInSlot) return false;
  bool carries = joint.drive || joint.latch;
  data::VisitJointEffects(joint, [&](const auto& effect) { carries = carries || effect; });
  return carries;
}

data::Scene WithEndBodies(const data::Scene& scene) { return EndBodies(scene).Run(); }

double ShareOf(const data::SceneBeam& beam, int k) {
  if (beam.section.uniform()) return beam.mass / beam.segments;
  const auto n = static_cast<double>(beam.segments);
  return beam.mass * beam.section.MassPart(k / n, (k + 1) / n);
}

double SegmentMass(const data::SceneBeam& beam, int k) {
  const double m = ShareOf(beam, k);
  double part = 1.0;
  for (const bool start : {true, false}) {
    if (!beam.carried_ends[start ? 0 : 1]) continue;
    const double given = kMassPart * ShareOf(beam, start ? 0 : beam.segments - 1) / m;
    const int from_end = start ? k : beam.segments - 1 - k;
    if (beam.segments == 1) {
      part -= given;
    } else if (from_end == 0) {
      part -= 1.5 * given;
    } else if (from_end == 1) {
      part += 0.5 * given;  // keeps the first moment
    }
  }
  return part * m;
}

}  // namespace unfurl::sim
