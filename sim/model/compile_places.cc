// Where everything is at the start.
#include <fmt/format.h>

#include "base/error.h"
#include "sim/model/compiler.h"

namespace unfurl::sim {

void Compiler::MakeLinks() {
  for (const data::SceneJoint& joint : scene_.joints) {
    using JointKind = data::SceneJoint::Kind;
    const bool slot = joint.kind != JointKind::kRevolute;
    Link link;
    link.name = joint.name;
    link.where = joint.where;
    link.turns = joint.kind != JointKind::kSlider;
    link.slides = slot;
    link.theta_driven = !slot && joint.drive;
    link.travel_driven = slot && joint.drive;
    link.inner = NodeOf(joint.inner);
    link.outer = NodeOf(joint.outer);
    // In a slot the link's x axis is the slot; outer keeps its angle against inner.
    const double axis = slot ? joint.axis : joint.zero_angle;
    link.inner_in = InNode(joint.inner) * PlanePose{0.0, 0.0, axis};
    link.outer_in = InNode(joint.outer);
    if (slot) link.outer_in = link.outer_in * PlanePose{0.0, 0.0, joint.axis - joint.zero_angle};
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
void Compiler::PlaceAll() {
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
  // Roots: the ground, what has a place, bodies, beams, and last the bodies of beams' ends.
  std::vector<int> roots{0};
  const auto implied = [&](int n) {
    return n < NodeOfBeam(0) && !merged_.list[n].members.empty() &&
           scene_.bodies[merged_.list[n].members.front()].implied;
  };
  for (int n = 1; n < nodes; ++n) {
    if (!placed_by[n].empty()) roots.push_back(n);
  }
  for (const bool last : {false, true}) {
    for (int n = 1; n < nodes; ++n) {
      if (implied(n) == last) roots.push_back(n);
    }
  }
  const Assembly assembly(nodes, links_, roots);
  for (int n = 0; n < nodes; ++n) {
    if (placed_by[n].empty() || assembly.RootOf(n) == n) continue;
    throw Error(fmt::format("the place of '{}' follows from the joints", placed_by[n]), where[n],
                "remove its pose and velocity, or those of the body that it hangs on");
  }
  LinkCoordinates at{std::vector<double>(links_.size()), std::vector<double>(links_.size())};
  LinkCoordinates rate = at, hang = at;
  for (std::size_t j = 0; j < scene_.joints.size(); ++j) {
    const data::SceneJoint& joint = scene_.joints[j];
    at.theta[j] = joint.theta;
    at.travel[j] = joint.travel;
    rate.theta[j] = joint.theta_rate;
    rate.travel[j] = joint.travel_rate;
    hang.theta[j] = joint.hang_theta;
    hang.travel[j] = joint.hang_travel;
    if (!joint.drive) continue;
    const data::TimeValue drive = TargetOf(joint).At(0.0);
    (links_[j].slides ? at.travel : at.theta)[j] = drive.value;
    (links_[j].slides ? rate.travel : rate.theta)[j] = drive.rate;
  }
  start_ = assembly.Place(pose, velocity, at, rate);
  if (scene_.suspension) hang_ = assembly.Place(pose, velocity, hang, rate);
}

data::TimeFunction Compiler::TargetOf(const data::SceneJoint& joint) const {
  const data::SceneDrive& drive = *joint.drive;
  if (!drive.by_rate) {
    if (const auto jump = drive.function.FindJump(scene_.duration)) {
      throw Error(fmt::format("the drive of '{}' jumps at t = {:.9g} s, which no force can follow",
                              joint.name, *jump),
                  joint.where + ".drive.position", "join its pieces, with smoothstep for one");
    }
    return drive.function;
  }
  const bool slot = joint.kind != data::SceneJoint::Kind::kRevolute;
  return drive.function.Integral(slot ? joint.travel : joint.theta, scene_.duration);
}

}  // namespace unfurl::sim
