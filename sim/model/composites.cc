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
  const int ground = bodies;  // as a node
  std::vector<std::vector<int>> welds_at(bodies + 1);
  double size = 0.0;  // of the welds [m]
  const auto node = [&](const SceneEnd& end) {
    return end.kind == SceneEnd::Kind::kGround ? ground : end.index;
  };
  for (std::size_t w = 0; w < scene.welds.size(); ++w) {
    if (!JoinsBodies(scene.welds[w])) continue;
    const int a = node(scene.welds[w].inner), b = node(scene.welds[w].outer);
    if (a == b) {
      throw Error("the weld joins a body to itself", scene.welds[w].where, "weld two bodies");
    }
    welds_at[a].push_back(static_cast<int>(w));
    welds_at[b].push_back(static_cast<int>(w));
    for (const SceneEnd* end : {&scene.welds[w].inner, &scene.welds[w].outer}) {
      size = std::max(size, std::hypot(end->point[0], end->point[1]));
    }
  }
  Composites result;
  result.of_body.assign(bodies, -1);
  result.body_in.assign(bodies, {});
  std::vector<PlanePose> pose(bodies + 1);
  std::vector<int> of_node(bodies + 1, -1);
  const auto grow = [&](int root) {
    const int id = static_cast<int>(result.list.size());
    result.list.emplace_back();
    result.list.back().ground = root == ground;
    std::vector<int> queue{root};
    of_node[root] = id;
    for (std::size_t k = 0; k < queue.size(); ++k) {
      const int at = queue[k];
      if (at != ground) result.list[id].members.push_back(at);
      for (const int w : welds_at[at]) {
        const data::SceneWeld& weld = scene.welds[w];
        const bool forward = node(weld.inner) == at;
        const int other = node(forward ? weld.outer : weld.inner);
        const PlanePose step = forward ? OuterInInner(weld) : OuterInInner(weld).Inverse();
        const PlanePose there = pose[at] * step;
        if (of_node[other] < 0) {
          of_node[other] = id;
          pose[other] = there;
          queue.push_back(other);
        } else {
          const double turns = std::remainder(there.angle - pose[other].angle, 2.0 * M_PI);
          if (std::hypot(there.x - pose[other].x, there.y - pose[other].y) > kSamePlace * size ||
              std::fabs(turns) > kSamePlace) {
            throw Error(fmt::format("weld '{}' contradicts the other welds", weld.name), weld.where,
                        "remove it, or make the places agree");
          }
        }
      }
    }
  };
  grow(ground);
  for (int b = 0; b < bodies; ++b) {
    if (of_node[b] < 0) grow(b);
  }
  for (Composite& composite : result.list) {
    double mx = 0.0, my = 0.0;
    for (const int b : composite.members) {
      composite.mass += scene.bodies[b].mass;
      mx += scene.bodies[b].mass * pose[b].x;
      my += scene.bodies[b].mass * pose[b].y;
    }
    const PlanePose centre =
        composite.ground ? PlanePose{} : PlanePose{mx / composite.mass, my / composite.mass, 0.0};
    for (const int b : composite.members) {
      result.of_body[b] = of_node[b];
      PlanePose& in = result.body_in[b];
      in = centre.Inverse() * pose[b];
      composite.inertia +=
          scene.bodies[b].inertia + scene.bodies[b].mass * (in.x * in.x + in.y * in.y);
    }
  }
  return result;
}

}  // namespace unfurl::sim
