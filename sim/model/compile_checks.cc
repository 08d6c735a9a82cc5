// What a scene holds together and starts with, as far as it may be meant otherwise.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/text.h"
#include "sim/dynamics/dynamics.h"
#include "sim/model/compiler.h"

namespace unfurl::sim {

// Parts that nothing joins to each other, and parts that nothing joins to the ground where gravity
// acts: both may be meant, and both are what a forgotten joint looks like.
void Compiler::WarnOfLooseParts() {
  const int nodes = NodeOfBeam(static_cast<int>(scene_.beams.size()));
  std::vector<int> root(nodes);
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](int n) {
    while (root[n] != n) n = root[n] = root[root[n]];
    return n;
  };
  // The ground keeps its number.
  const auto join = [&](int a, int b) {
    root[std::max(find(a), find(b))] = std::min(find(a), find(b));
  };
  for (const Link& link : links_) join(link.inner, link.outer);
  for (const data::SceneLinearSpring& spring : scene_.linear_springs) {
    join(NodeOf(spring.a), NodeOf(spring.b));
  }
  const auto name = [&](int n) {
    if (n == 0) return std::string("the ground");
    if (n >= NodeOfBeam(0)) return "'" + scene_.beams[n - NodeOfBeam(0)].name + "'";
    return "'" + scene_.bodies[merged_.list[n].members.front()].name + "'";
  };
  std::vector<std::string> parts, falling;
  bool grounded = false;
  for (int n = 1; n < nodes; ++n) {
    if (find(n) == 0) grounded = true;
    if (find(n) == n) parts.push_back(name(n));
  }
  if (scene_.gravity && !scene_.suspension &&
      std::hypot(scene_.gravity->acceleration[0], scene_.gravity->acceleration[1]) > 0.0) {
    falling = parts;
  }
  if (grounded && !parts.empty()) parts.insert(parts.begin(), name(0));
  if (parts.size() > 1) {
    model_.warnings.push_back(fmt::format(
        "nothing connects {}: each moves by itself; is a joint, weld or spring missing?",
        JoinWords(parts)));
  }
  if (!falling.empty()) {
    model_.warnings.push_back(fmt::format("gravity acts and nothing joins {} to the ground: {}",
                                          JoinWords(falling),
                                          falling.size() == 1 ? "it falls" : "they fall"));
  }
}

// Said and not refused, as `--set suspension=` may have taken the strings away.
void Compiler::WarnOfIdleKeys() {
  if (scene_.suspension) return;
  for (const data::SceneJoint& joint : scene_.joints) {
    for (const auto& [key, value] :
         {std::pair("hang_theta", joint.hang_theta), std::pair("hang_travel", joint.hang_travel)}) {
      if (value == 0.0) continue;
      model_.warnings.push_back(
          fmt::format("{}.{} does nothing: there is no [suspension]", joint.where, key));
    }
  }
}

// A latch that starts beyond its stop holds energy that nobody gave it: of a scene's own making it
// is what springs and weight have pressed in, and no more than they store.
void Compiler::CheckStops() {
  std::vector<std::string> names;
  std::size_t first = 0;
  for (std::size_t j = 0; j < model_.joints.size(); ++j) {
    const int k = model_.joints[j].latch;
    if (k < 0 || !model_.initial_modes[k].lower_contact) continue;
    if (names.empty()) first = j;
    names.push_back(fmt::format("'{}' by {:.3g} rad", model_.joints[j].name,
                                -scene_.joints[j].latch->theta_b - start_.at.theta[j]));
  }
  if (names.empty()) return;
  std::vector<double> state = model_.initial_state;
  const Balance b = Dynamics(model_).BalanceAt(0.0, state.data());
  const double contact = b.effects[EffectIndex<Latches>()];
  double others = b.Scale() - contact;
  if (scene_.gravity) {
    const double g = std::hypot(scene_.gravity->acceleration[0], scene_.gravity->acceleration[1]);
    for (const double mass : model_.rigid_bodies.mass) others += mass * g * model_.length_scale;
  }
  const std::string what =
      fmt::format("{} {} beyond the lower stop: the contact stores {:.3g} J, all else {:.3g} J",
                  JoinWords(names), names.size() == 1 ? "starts" : "start", contact, others);
  if (contact > others && others > 0.0) {
    throw Error(what, scene_.joints[first].where + ".theta",
                "start within the clearance (angles are in radians)");
  }
  model_.warnings.push_back(what);
}

}  // namespace unfurl::sim
