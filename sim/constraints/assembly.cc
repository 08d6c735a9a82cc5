#include "sim/constraints/assembly.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/text.h"

namespace unfurl::sim {
namespace {

// Newton's: with kLongestStep an angle turns once around in 13; near the solution it takes some
// four.
constexpr int kAssemblyMostIterations = 60;
// Gap of a closed loop, of the links' size and in rad: some thousand roundings, as the paths
// through a loop of a hundred links add up to.
constexpr double kClosed = 1e-11;
constexpr double kRounded = 16.0;  // units in the last place, of places around a loop [-]
constexpr double kAssemblyLongestStep = 0.5;  // of an angle in one iteration [rad]

}  // namespace

Assembly::Assembly(int nodes, std::vector<Link> links, const std::vector<int>& root_order)
    : links_(std::move(links)), root_(nodes, -1), parent_(nodes, -1) {
  // Of a node's points from one another, not from its origin: the ground's may be anywhere.
  std::vector<Eigen::Vector3d> mean(static_cast<std::size_t>(nodes), Eigen::Vector3d::Zero());
  const auto each_point = [&](const auto& visit) {
    for (const Link& link : links_) {
      visit(link.inner, Eigen::Vector2d(link.inner_in.x, link.inner_in.y));
      visit(link.outer, Eigen::Vector2d(link.outer_in.x, link.outer_in.y));
    }
  };
  each_point([&](int node, const Eigen::Vector2d& p) {
    mean[static_cast<std::size_t>(node)] += Eigen::Vector3d(p.x(), p.y(), 1.0);
  });
  each_point([&](int node, const Eigen::Vector2d& p) {
    const Eigen::Vector3d& of = mean[static_cast<std::size_t>(node)];
    size_ = std::max(size_, (p - of.head<2>() / of.z()).norm());
  });
  if (!(size_ > 0.0)) size_ = 1.0;  // all points coincide: no loop has a length to close
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

void Assembly::PlaceNodes(const std::vector<PlanePose>& root_pose, const LinkCoordinates& at,
                          std::vector<PlanePose>* node) const {
  for (const int n : order_) {
    if (parent_[n] < 0) {
      (*node)[n] = root_pose[n];
      continue;
    }
    const int k = parent_[n];
    const Link& link = links_[k];
    const PlanePose step{link.sign * at.travel[k], 0.0, link.sign * at.theta[k]};
    if (link.outer == n) {
      (*node)[n] = (*node)[link.inner] * link.inner_in * step * link.outer_in.Inverse();
    } else {
      (*node)[n] = (*node)[link.outer] * link.outer_in * step.Inverse() * link.inner_in.Inverse();
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

// The gaps of the cut links, in the frame of each link's inner side, and how they change with the
// free coordinates. Rows that a free coordinate takes up are left out. Lengths, travels included,
// count in units of size_, so that they weigh like angles whatever the mechanism's size.
struct Assembly::LoopSystem {
  std::vector<Unknown> unknowns;
  std::vector<std::array<int, 2>> column;  // by link: of theta, of travel; -1
  std::vector<int> first_row;              // by cut
  Eigen::MatrixXd J;
  Eigen::VectorXd gap;

  static bool FixesTravel(const Link& link) { return !link.slides || link.travel_driven; }
  static bool FixesAngle(const Link& link) { return !link.turns || link.theta_driven; }
  static bool Has(const Link& link, int row) {
    return row == 1 || (row == 0 ? FixesTravel(link) : FixesAngle(link));
  }
};

Assembly::LoopSystem Assembly::FindLoops() const {
  LoopSystem loops;
  loops.column.assign(links_.size(), {-1, -1});
  int rows = 0;
  for (const int cut : cut_) {
    loops.first_row.push_back(rows);
    for (int row = 0; row < 3; ++row) rows += LoopSystem::Has(links_[cut], row) ? 1 : 0;
    for (const int k : LoopOf(cut)) {
      const Link& link = links_[k];
      const auto take = [&](bool free, bool travel) {
        int& column = loops.column[k][travel ? 1 : 0];
        if (!free || column >= 0) return;
        column = static_cast<int>(loops.unknowns.size());
        loops.unknowns.push_back({k, travel});
      };
      take(link.turns && !link.theta_driven, false);
      take(link.slides && !link.travel_driven, true);
    }
  }
  loops.gap.resize(rows);
  loops.J.resize(rows, static_cast<Eigen::Index>(std::max<std::size_t>(loops.unknowns.size(), 1)));
  return loops;
}

void Assembly::Linearise(const std::vector<PlanePose>& node, const LinkCoordinates& at,
                         LoopSystem* loops) const {
  loops->J.setZero();
  for (std::size_t c = 0; c < cut_.size(); ++c) {
    const Link& link = links_[cut_[c]];
    const PlanePose a = node[link.inner] * link.inner_in;
    const PlanePose b = node[link.outer] * link.outer_in;
    const double ca = std::cos(a.angle), sa = std::sin(a.angle);
    const auto put = [&](auto&& target, double x, double y, double angle) {
      int row = loops->first_row[c];
      if (LoopSystem::FixesTravel(link)) target(row++, (ca * x + sa * y) / size_);
      target(row++, (ca * y - sa * x) / size_);
      if (LoopSystem::FixesAngle(link)) target(row, angle);
    };
    put([&](int row, double v) { loops->gap[row] = v; },
        b.x - a.x - link.sign * at.travel[cut_[c]] * ca,
        b.y - a.y - link.sign * at.travel[cut_[c]] * sa,
        std::remainder(b.angle - a.angle - link.sign * at.theta[cut_[c]], 2.0 * M_PI));
    // Both sides are moved at b: the inner one carries its frame along.
    for (const bool outer : {false, true}) {
      int at_node = outer ? link.outer : link.inner;
      const double side = outer ? 1.0 : -1.0;
      for (const int k : PathToRoot(at_node)) {
        const Link& joint = links_[k];
        const bool away = joint.outer == at_node;  // the link moves its outer node
        const PlanePose frame = node[joint.inner] * joint.inner_in;
        const PlanePose pin = node[joint.outer] * joint.outer_in;
        at_node = away ? joint.inner : joint.outer;
        const double turn = side * (away ? joint.sign : -joint.sign);
        if (const int column = loops->column[k][0]; column >= 0) {
          put([&](int row, double v) { loops->J(row, column) += v; }, -turn * (b.y - pin.y),
              turn * (b.x - pin.x), turn);
        }
        if (const int column = loops->column[k][1]; column >= 0) {
          put([&](int row, double v) { loops->J(row, column) += v; },
              turn * size_ * std::cos(frame.angle), turn * size_ * std::sin(frame.angle), 0.0);
        }
      }
    }
  }
}

void Assembly::CloseLoops(const std::vector<PlanePose>& root_pose, LoopSystem* loops,
                          LinkCoordinates* at) const {
  std::vector<PlanePose> node(root_.size());
  for (int iteration = 0;; ++iteration) {
    PlaceNodes(root_pose, *at, &node);
    Linearise(node, *at, loops);
    double far = 0.0;  // from the world's origin, where places are rounded by more
    for (const PlanePose& pose : node) far = std::max(far, std::hypot(pose.x, pose.y));
    const double rounding = kRounded * std::numeric_limits<double>::epsilon() * far / size_;
    if (loops->gap.cwiseAbs().maxCoeff() <= kClosed + rounding) return;
    if (iteration == kAssemblyMostIterations || loops->unknowns.empty()) FailToClose(*loops);
    const Eigen::VectorXd step = loops->J.completeOrthogonalDecomposition().solve(-loops->gap);
    const double longest = step.cwiseAbs().maxCoeff();
    if (!std::isfinite(longest)) FailToClose(*loops);
    const double scale = longest > kAssemblyLongestStep ? kAssemblyLongestStep / longest : 1.0;
    for (std::size_t u = 0; u < loops->unknowns.size(); ++u) {
      const Unknown& unknown = loops->unknowns[u];
      (unknown.travel ? at->travel : at->theta)[unknown.link] +=
          (unknown.travel ? size_ : 1.0) * scale * step[static_cast<Eigen::Index>(u)];
    }
  }
}

void Assembly::FailToClose(const LoopSystem& loops) const {
  std::size_t worst = 0;
  double largest = -1.0;
  for (std::size_t c = 0; c < cut_.size(); ++c) {
    const Eigen::Index end = c + 1 < cut_.size() ? loops.first_row[c + 1] : loops.gap.size();
    const double g = loops.gap.segment(loops.first_row[c], end - loops.first_row[c]).norm();
    if (!(g <= largest)) {
      largest = g;
      worst = c;
    }
  }
  std::vector<std::string> names, driven;
  const auto take = [&](const Link& link) {
    names.push_back("'" + link.name + "'");
    if (link.theta_driven || link.travel_driven) driven.push_back(names.back());
  };
  for (const int k : LoopOf(cut_[worst])) {
    if (links_[k].turns || links_[k].slides) take(links_[k]);
  }
  const Link& link = links_[cut_[worst]];
  take(link);
  const std::string drives =
      driven.size() < 2 ? "" : fmt::format(" (the drives of {} may conflict)", JoinWords(driven));
  throw Error(fmt::format("the loop through {} cannot close: a gap of {:.3g} m is left at '{}'{}",
                          JoinWords(names), largest * size_, link.name, drives),
              link.where, "change the lengths or points of the loop, or the starting angles");
}

void Assembly::MoveNodes(const std::vector<PlanePose>& root_velocity, const LinkCoordinates& rate,
                         const LinkCoordinates& at, Placement* placement) const {
  const std::vector<PlanePose>& node = placement->node;
  for (const int n : order_) {
    if (parent_[n] < 0) {
      placement->velocity[n] = root_velocity[n];
      continue;
    }
    const int k = parent_[n];
    const Link& link = links_[k];
    const bool away = link.outer == n;
    const int from = away ? link.inner : link.outer;
    const double side = away ? link.sign : -link.sign;
    const PlanePose slot = node[link.inner] * link.inner_in;
    const PlanePose pin = node[link.outer] * link.outer_in;
    const PlanePose& base = placement->velocity[from];
    const double turn = link.turns ? rate.theta[k] : 0.0;
    const double slide = link.slides ? rate.travel[k] : 0.0;
    const double ex = std::cos(slot.angle), ey = std::sin(slot.angle);
    const double spin = base.angle + side * turn;
    // The slot turns with inner: seen from outer, the travel turns with the inner side's rate.
    const double slot_spin = away ? base.angle : spin;
    const double x = away ? pin.x : slot.x, y = away ? pin.y : slot.y;  // a point of node n
    double vx, vy;
    if (away) {
      vx = base.x - base.angle * (pin.y - node[from].y) + side * slide * ex;
      vy = base.y + base.angle * (pin.x - node[from].x) + side * slide * ey;
    } else {
      const double travel = link.sign * at.travel[k];
      vx = base.x - base.angle * (pin.y - node[from].y) + side * slide * ex +
           slot_spin * travel * ey;
      vy = base.y + base.angle * (pin.x - node[from].x) + side * slide * ey -
           slot_spin * travel * ex;
    }
    placement->velocity[n] = {vx - spin * (node[n].y - y), vy + spin * (node[n].x - x), spin};
  }
}

void Assembly::CloseRates(const std::vector<PlanePose>& root_velocity, LoopSystem* loops,
                          Placement* placement, LinkCoordinates* rate) const {
  // What the rates as given leave open, by row of the system.
  Eigen::VectorXd open(loops->gap.size());
  for (std::size_t c = 0; c < cut_.size(); ++c) {
    const int k = cut_[c];
    const Link& link = links_[k];
    const PlanePose a = placement->node[link.inner] * link.inner_in;
    const PlanePose b = placement->node[link.outer] * link.outer_in;
    const PlanePose& vi = placement->velocity[link.inner];
    const PlanePose& vo = placement->velocity[link.outer];
    const PlanePose& pi = placement->node[link.inner];
    const PlanePose& po = placement->node[link.outer];
    const double x = (vo.x - vo.angle * (b.y - po.y)) - (vi.x - vi.angle * (b.y - pi.y));
    const double y = (vo.y + vo.angle * (b.x - po.x)) - (vi.y + vi.angle * (b.x - pi.x));
    const double ca = std::cos(a.angle), sa = std::sin(a.angle);
    int row = loops->first_row[c];
    if (LoopSystem::FixesTravel(link)) {
      open[row++] =
          (ca * x + sa * y - (link.travel_driven ? link.sign * rate->travel[k] : 0.0)) / size_;
    }
    open[row++] = (ca * y - sa * x) / size_;
    if (LoopSystem::FixesAngle(link)) {
      open[row] = vo.angle - vi.angle - (link.theta_driven ? link.sign * rate->theta[k] : 0.0);
    }
  }
  if (loops->unknowns.empty() || open.cwiseAbs().maxCoeff() == 0.0) return;
  const Eigen::VectorXd step = loops->J.completeOrthogonalDecomposition().solve(-open);
  for (std::size_t u = 0; u < loops->unknowns.size(); ++u) {
    const Unknown& unknown = loops->unknowns[u];
    (unknown.travel ? rate->travel : rate->theta)[unknown.link] +=
        (unknown.travel ? size_ : 1.0) * step[static_cast<Eigen::Index>(u)];
  }
  MoveNodes(root_velocity, *rate, placement->at, placement);
}

Placement Assembly::Place(const std::vector<PlanePose>& root_pose,
                          const std::vector<PlanePose>& root_velocity, LinkCoordinates at,
                          LinkCoordinates rate) const {
  LoopSystem loops = FindLoops();
  if (!cut_.empty()) CloseLoops(root_pose, &loops, &at);
  Placement placement;
  placement.node.resize(root_.size());
  placement.velocity.resize(root_.size());
  PlaceNodes(root_pose, at, &placement.node);
  MoveNodes(root_velocity, rate, at, &placement);
  placement.at = at;
  if (!cut_.empty()) {
    Linearise(placement.node, at, &loops);
    CloseRates(root_velocity, &loops, &placement, &rate);
  }
  // Coordinates of the links that the tree does not use follow from the places.
  for (const int k : cut_) {
    const Link& link = links_[k];
    const PlanePose seen = (placement.node[link.inner] * link.inner_in).Inverse() *
                           (placement.node[link.outer] * link.outer_in);
    double& theta = placement.at.theta[k];
    if (link.turns && !link.theta_driven)
      theta += std::remainder(link.sign * seen.angle - theta, 2.0 * M_PI);
    if (link.slides && !link.travel_driven) placement.at.travel[k] = link.sign * seen.x;
  }
  return placement;
}

}  // namespace unfurl::sim
