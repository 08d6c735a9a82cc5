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

namespace {

// Poses and velocities that the scene gives to bodies and beams, by node.
struct GivenPlaces {
  explicit GivenPlaces(int nodes) : pose(nodes), velocity(nodes), placed_by(nodes), where(nodes) {}

  // `in`: the pose of the part in its node. The velocity is carried over to the node's origin,
  // v_node = v + omega x (node - part).
  template <typename Part>
  void Take(int node, const Part& part, const PlanePose& in) {
    if (!part.pose && !part.velocity) return;
    if (!placed_by[node].empty()) {
      throw Error(fmt::format("'{}' and '{}' are welded together and both have a place",
                              placed_by[node], part.name),
                  part.where, "keep one");
    }
    placed_by[node] = part.name;
    where[node] = part.where;
    if (part.pose) {
      const std::array<double, 3>& p = *part.pose;
      pose[node] = PlanePose{p[0], p[1], p[2]} * in.Inverse();
    }
    if (part.velocity) {
      const std::array<double, 3>& v = *part.velocity;
      const PlanePose world = pose[node] * in;
      const double dx = pose[node].x - world.x, dy = pose[node].y - world.y;
      velocity[node] = {v[0] - v[2] * dy, v[1] + v[2] * dx, v[2]};
    }
  }

  std::vector<PlanePose> pose, velocity;
  std::vector<std::string> placed_by, where;  // name and place in the file; empty: not given
};

}  // namespace

// Each connected component of the links may have one place, at the node that then is its root; the
// places of all else follow along a spanning tree.
void Compiler::PlaceAll() {
  const int nodes = NodeOfBeam(static_cast<int>(scene_.beams.size()));
  GivenPlaces given(nodes);
  for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
    given.Take(merged_.of_body[b], scene_.bodies[b], merged_.body_in[b]);
  }
  for (std::size_t b = 0; b < scene_.beams.size(); ++b) {
    given.Take(NodeOfBeam(static_cast<int>(b)), scene_.beams[b], {});
  }
  const Assembly assembly(nodes, links_, Roots(given.placed_by));
  for (int n = 0; n < nodes; ++n) {
    if (given.placed_by[n].empty() || assembly.RootOf(n) == n) continue;
    throw Error(fmt::format("the place of '{}' follows from the joints", given.placed_by[n]),
                given.where[n],
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
  start_ = assembly.Place(given.pose, given.velocity, at, rate);
  if (scene_.suspension) hang_ = assembly.Place(given.pose, given.velocity, hang, rate);
}

// Nodes in the order in which they may become roots: the ground, what has a place, bodies and
// beams, and last the bodies of beams' ends.
std::vector<int> Compiler::Roots(const std::vector<std::string>& placed_by) const {
  const int nodes = static_cast<int>(placed_by.size());
  std::vector<int> placed{0}, own, implied;
  for (int n = 1; n < nodes; ++n) {
    if (!placed_by[n].empty()) placed.push_back(n);
    const bool is_body = n < NodeOfBeam(0) && !merged_.list[n].members.empty();
    const bool is_implied = is_body && scene_.bodies[merged_.list[n].members.front()].implied;
    (is_implied ? implied : own).push_back(n);
  }
  std::vector<int> roots = std::move(placed);
  roots.insert(roots.end(), own.begin(), own.end());
  roots.insert(roots.end(), implied.begin(), implied.end());
  return roots;
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
