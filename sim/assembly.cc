#include "sim/assembly.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/text.h"

namespace unfurl::sim {
namespace {

constexpr int kMostIterations = 60;
constexpr double kClosed = 1e-11;     // gap of a closed loop [m], [rad], per metre of size
constexpr double kLongestStep = 0.5;  // of an angle in one iteration [rad]

}  // namespace

Assembly::Assembly(int nodes, std::vector<Link> links, const std::vector<int>& root_order)
    : links_(std::move(links)), root_(nodes, -1), parent_(nodes, -1) {
  std::vector<std::vector<int>> at(nodes);
  for (std::size_t k = 0; k < links_.size(); ++k) {
    at[links_[k].inner].push_back(static_cast<int>(k));
    at[links_[k].outer].push_back(static_cast<int>(k));
  }
  std::vector<std::uint8_t> in_tree(links_.size(), 0);
  for (const int root : root_order) {
    if (root_[root] >= 0) continue;
    root_[root] = root;
    std::size_t next = order_.size();
    order_.push_back(root);
    for (; next < order_.size(); ++next) {
      for (const int k : at[order_[next]]) {
        const int other = links_[k].inner == order_[next] ? links_[k].outer : links_[k].inner;
        if (root_[other] >= 0) continue;
        root_[other] = root;
        parent_[other] = k;
        in_tree[k] = 1;
        order_.push_back(other);
      }
    }
  }
  for (std::size_t k = 0; k < links_.size(); ++k) {
    if (!in_tree[k]) cut_.push_back(static_cast<int>(k));
  }
}

void Assembly::PlaceNodes(const std::vector<PlanePose>& root_pose, const std::vector<double>& theta,
                          std::vector<PlanePose>* node) const {
  for (const int n : order_) {
    if (parent_[n] < 0) {
      (*node)[n] = root_pose[n];
      continue;
    }
    const Link& link = links_[parent_[n]];
    const PlanePose turn{0.0, 0.0, link.sign * theta[parent_[n]]};
    if (link.outer == n) {
      (*node)[n] = (*node)[link.inner] * link.inner_in * turn * link.outer_in.Inverse();
    } else {
      (*node)[n] = (*node)[link.outer] * link.outer_in * turn.Inverse() * link.inner_in.Inverse();
    }
  }
}

std::vector<int> Assembly::PathToRoot(int node) const {
  std::vector<int> path;
  while (parent_[node] >= 0) {
    const Link& link = links_[parent_[node]];
    path.push_back(parent_[node]);
    node = link.outer == node ? link.inner : link.outer;
  }
  return path;
}

std::vector<int> Assembly::LoopOf(int cut) const {
  std::vector<int> a = PathToRoot(links_[cut].inner), b = PathToRoot(links_[cut].outer);
  while (!a.empty() && !b.empty() && a.back() == b.back()) {
    a.pop_back();
    b.pop_back();
  }
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

void Assembly::CloseLoops(const std::vector<PlanePose>& root_pose,
                          std::vector<double>* theta) const {
  if (cut_.empty()) return;
  std::vector<int> unknown(links_.size(), -1);  // column of each joint that some loop passes
  int columns = 0, rows = 0;
  std::vector<int> first_row;
  for (const int cut : cut_) {
    first_row.push_back(rows);
    rows += links_[cut].revolute ? 2 : 3;
    for (const int k : LoopOf(cut)) {
      if (links_[k].revolute && unknown[k] < 0) unknown[k] = columns++;
    }
  }
  std::vector<PlanePose> node(root_.size());
  Eigen::VectorXd gap(rows);
  double size = 1.0;
  for (int iteration = 0;; ++iteration) {
    PlaceNodes(root_pose, *theta, &node);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(rows, std::max(columns, 1));
    for (std::size_t c = 0; c < cut_.size(); ++c) {
      const Link& link = links_[cut_[c]];
      const PlanePose a = node[link.inner] * link.inner_in;
      const PlanePose b = node[link.outer] * link.outer_in;
      const int row = first_row[c];
      gap[row] = b.x - a.x;
      gap[row + 1] = b.y - a.y;
      if (!link.revolute) gap[row + 2] = std::remainder(b.angle - a.angle, 2.0 * M_PI);
      for (const bool outer : {false, true}) {
        const PlanePose& end = outer ? b : a;
        int at = outer ? link.outer : link.inner;
        const double side = outer ? 1.0 : -1.0;
        for (const int k : PathToRoot(at)) {
          const Link& joint = links_[k];
          const bool away = joint.outer == at;  // the link turns its outer node
          const PlanePose pin = node[joint.inner] * joint.inner_in;
          at = away ? joint.inner : joint.outer;
          if (unknown[k] < 0) continue;
          const double turn = side * (away ? joint.sign : -joint.sign);
          J(row, unknown[k]) -= turn * (end.y - pin.y);
          J(row + 1, unknown[k]) += turn * (end.x - pin.x);
          if (!link.revolute) J(row + 2, unknown[k]) += turn;
          size = std::max(size, std::hypot(end.x - pin.x, end.y - pin.y));
        }
      }
    }
    if (gap.cwiseAbs().maxCoeff() <= kClosed * size) return;
    if (iteration == kMostIterations || columns == 0) break;
    const Eigen::VectorXd step = J.completeOrthogonalDecomposition().solve(-gap);
    const double longest = step.cwiseAbs().maxCoeff();
    if (!std::isfinite(longest)) break;
    const double scale = longest > kLongestStep ? kLongestStep / longest : 1.0;
    for (std::size_t k = 0; k < links_.size(); ++k) {
      if (unknown[k] >= 0) (*theta)[k] += scale * step[unknown[k]];
    }
  }
  // Name the worst loop.
  std::size_t worst = 0;
  double largest = 0.0;
  for (std::size_t c = 0; c < cut_.size(); ++c) {
    const double g = gap.segment(first_row[c], links_[cut_[c]].revolute ? 2 : 3).norm();
    if (g > largest) {
      largest = g;
      worst = c;
    }
  }
  std::vector<std::string> names;
  for (const int k : LoopOf(cut_[worst])) {
    if (links_[k].revolute) names.push_back("'" + links_[k].name + "'");
  }
  const Link& link = links_[cut_[worst]];
  names.push_back("'" + link.name + "'");
  throw Error(fmt::format("the loop through {} cannot close: a gap of {:.3g} m is left at '{}'",
                          JoinWords(names), largest, link.name),
              link.where, "change the lengths or points of the loop, or the starting angles");
}

Placement Assembly::Place(const std::vector<PlanePose>& root_pose,
                          const std::vector<PlanePose>& root_velocity, std::vector<double> theta,
                          const std::vector<double>& rate) const {
  CloseLoops(root_pose, &theta);
  Placement placement;
  placement.node.resize(root_.size());
  placement.velocity.resize(root_.size());
  PlaceNodes(root_pose, theta, &placement.node);
  for (const int n : order_) {
    if (parent_[n] < 0) {
      placement.velocity[n] = root_velocity[n];
      continue;
    }
    const Link& link = links_[parent_[n]];
    const bool away = link.outer == n;
    const int from = away ? link.inner : link.outer;
    const PlanePose pin = placement.node[link.inner] * link.inner_in;
    const PlanePose& base = placement.velocity[from];
    const double spin =
        base.angle + (away ? link.sign : -link.sign) * (link.revolute ? rate[parent_[n]] : 0.0);
    const PlanePose& here = placement.node[n];
    const PlanePose& there = placement.node[from];
    placement.velocity[n] = {base.x - base.angle * (pin.y - there.y) - spin * (here.y - pin.y),
                             base.y + base.angle * (pin.x - there.x) + spin * (here.x - pin.x),
                             spin};
  }
  // Angles of the links that the tree does not use follow from the places.
  for (const int k : cut_) {
    const Link& link = links_[k];
    const double turned = (placement.node[link.outer] * link.outer_in).angle -
                          (placement.node[link.inner] * link.inner_in).angle;
    theta[k] += std::remainder(link.sign * turned - theta[k], 2.0 * M_PI);
  }
  placement.theta = std::move(theta);
  return placement;
}

}  // namespace unfurl::sim
