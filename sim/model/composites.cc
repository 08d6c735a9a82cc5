#include "sim/model/composites.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace unfurl::sim {
namespace {

using data::SceneEnd;

// Of the farthest point of a weld from its body, and in rad: welds written twice may differ by the
// digits that a person writes.
constexpr double kSamePlace = 1e-9;

// Pose of the outer body in the inner's frame.
PlanePose OuterInInner(const data::SceneWeld& weld) {
  const PlanePose at_point{weld.inner.point[0], weld.inner.point[1], weld.angle};
  const PlanePose to_centre{-weld.outer.point[0], -weld.outer.point[1], 0.0};
  return at_point * to_centre;
}

// Bodies and the ground, joined by welds.
class WeldGraph {
 public:
  explicit WeldGraph(const data::Scene& scene)
      : scene_(scene),
        welds_at_(scene.bodies.size() + 1),
        pose_(scene.bodies.size() + 1),
        reached_(scene.bodies.size() + 1, false) {
    for (std::size_t w = 0; w < scene.welds.size(); ++w) {
      const data::SceneWeld& weld = scene.welds[w];
      if (!JoinsBodies(weld)) continue;
      const int a = NodeOf(weld.inner), b = NodeOf(weld.outer);
      if (a == b) throw Error("the weld joins a body to itself", weld.where, "weld two bodies");
      welds_at_[a].push_back(static_cast<int>(w));
      welds_at_[b].push_back(static_cast<int>(w));
      for (const SceneEnd* end : {&weld.inner, &weld.outer}) {
        size_ = std::max(size_, std::hypot(end->point[0], end->point[1]));
      }
    }
  }

  int ground() const { return static_cast<int>(scene_.bodies.size()); }
  bool IsReached(int node) const { return reached_[node]; }
  // In the frame of the node that its composite was grown from.
  const PlanePose& pose(int node) const { return pose_[node]; }

  // All that welds join to `root`, breadth first.
  Composite Grow(int root) {
    Composite composite;
    composite.ground = root == ground();
    std::vector<int> queue{root};
    reached_[root] = true;
    for (std::size_t k = 0; k < queue.size(); ++k) {
      const int at = queue[k];
      if (at != ground()) composite.members.push_back(at);
      for (const int w : welds_at_[at]) {
        const data::SceneWeld& weld = scene_.welds[w];
        const bool forward = NodeOf(weld.inner) == at;
        const int other = NodeOf(forward ? weld.outer : weld.inner);
        const PlanePose step = forward ? OuterInInner(weld) : OuterInInner(weld).Inverse();
        const PlanePose there = pose_[at] * step;
        if (reached_[other]) {
          RefuseContradiction(weld, pose_[other], there);
          continue;
        }
        reached_[other] = true;
        pose_[other] = there;
        queue.push_back(other);
      }
    }
    return composite;
  }

 private:
  int NodeOf(const SceneEnd& end) const {
    return end.kind == SceneEnd::Kind::kGround ? ground() : end.index;
  }

  // A loop of welds must close.
  void RefuseContradiction(const data::SceneWeld& weld, const PlanePose& pose,
                           const PlanePose& there) const {
    const double turns = std::remainder(there.angle - pose.angle, 2.0 * M_PI);
    if (std::hypot(there.x - pose.x, there.y - pose.y) > kSamePlace * size_ ||
        std::fabs(turns) > kSamePlace) {
      throw Error(fmt::format("weld '{}' contradicts the other welds", weld.name), weld.where,
                  "remove it, or make the places agree");
    }
  }

  const data::Scene& scene_;
  std::vector<std::vector<int>> welds_at_;  // by node; the last is the ground
  std::vector<PlanePose> pose_;
  std::vector<bool> reached_;
  double size_ = 0.0;  // of the welds [m]
};

}  // namespace

PlanePose PlanePose::operator*(const PlanePose& inner) const {
  const double c = std::cos(angle), s = std::sin(angle);
  return {x + c * inner.x - s * inner.y, y + s * inner.x + c * inner.y, angle + inner.angle};
}

PlanePose PlanePose::Inverse() const {
  const double c = std::cos(angle), s = std::sin(angle);
  return {-c * x - s * y, s * x - c * y, -angle};
}

bool IsBeamEnd(const SceneEnd& end) {
  return end.kind == SceneEnd::Kind::kBeamStart || end.kind == SceneEnd::Kind::kBeamEnd;
}

bool JoinsBodies(const data::SceneWeld& weld) {
  return !IsBeamEnd(weld.inner) && !IsBeamEnd(weld.outer);
}

Composites MergeWeldedBodies(const data::Scene& scene) {
  const int bodies = static_cast<int>(scene.bodies.size());
  WeldGraph graph(scene);
  Composites result;
  result.of_body.assign(bodies, -1);
  result.body_in.assign(bodies, {});
  result.list.push_back(graph.Grow(graph.ground()));
  for (int b = 0; b < bodies; ++b) {
    if (!graph.IsReached(b)) result.list.push_back(graph.Grow(b));
  }
  for (std::size_t c = 0; c < result.list.size(); ++c) {
    Composite& composite = result.list[c];
    double mx = 0.0, my = 0.0;
    for (const int b : composite.members) {
      composite.mass += scene.bodies[b].mass;
      mx += scene.bodies[b].mass * graph.pose(b).x;
      my += scene.bodies[b].mass * graph.pose(b).y;
    }
    const PlanePose centre =
        composite.ground ? PlanePose{} : PlanePose{mx / composite.mass, my / composite.mass, 0.0};
    for (const int b : composite.members) {
      result.of_body[b] = static_cast<int>(c);
      PlanePose& in = result.body_in[b];
      in = centre.Inverse() * graph.pose(b);
      // The parallel axis theorem.
      composite.inertia +=
          scene.bodies[b].inertia + scene.bodies[b].mass * (in.x * in.x + in.y * in.y);
    }
  }
  return result;
}

}  // namespace unfurl::sim
