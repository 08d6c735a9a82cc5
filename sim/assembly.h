#pragma once

#include <string>
#include <vector>

#include "sim/composites.h"

namespace unfurl::sim {

// Where everything is at given joint angles, beams straight. Nodes are composites, then beams
// (frame at the start, x along the beam); links are revolute joints and the welds between a body
// and a beam. A spanning tree carries places outwards from each component's root; what is left over
// are loops, closed by changing the joint angles as little as possible (Gauss-Newton, least
// squares).
struct Link {
  std::string name;
  std::string where;
  bool revolute = false;
  int inner = -1, outer = -1;    // nodes
  PlanePose inner_in, outer_in;  // the link's frame in each node
  double sign = 1.0;             // outer angle = inner angle + sign * theta
};

struct Placement {
  std::vector<PlanePose> node;      // by node
  std::vector<double> theta;        // by link; closed values [rad]
  std::vector<PlanePose> velocity;  // by node: of its origin, and the angular one
};

class Assembly {
 public:
  // `parent`-less nodes are found by the order of `roots`, nodes that stand by themselves first.
  Assembly(int nodes, std::vector<Link> links, const std::vector<int>& root_order);

  // Roots of the components (each node's own), in order.
  int RootOf(int node) const { return root_[node]; }

  // `root_pose` and `root_velocity` by node (read at roots only); `theta` and `rate` by link.
  // Throws Error naming the joints of a loop that cannot close.
  Placement Place(const std::vector<PlanePose>& root_pose,
                  const std::vector<PlanePose>& root_velocity, std::vector<double> theta,
                  const std::vector<double>& rate) const;

 private:
  void PlaceNodes(const std::vector<PlanePose>& root_pose, const std::vector<double>& theta,
                  std::vector<PlanePose>* node) const;
  void CloseLoops(const std::vector<PlanePose>& root_pose, std::vector<double>* theta) const;
  // Tree links from a node to its root.
  std::vector<int> PathToRoot(int node) const;
  // Joints of the loop that a cut link closes.
  std::vector<int> LoopOf(int cut) const;

  std::vector<Link> links_;
  std::vector<int> root_;    // by node
  std::vector<int> parent_;  // tree link by node, -1 at roots
  std::vector<int> order_;   // nodes, parents first
  std::vector<int> cut_;     // links not in the tree
};

}  // namespace unfurl::sim
