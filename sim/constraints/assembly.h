#pragma once

#include <string>
#include <vector>

#include "sim/model/composites.h"

namespace unfurl::sim {

// Where everything is at given joint coordinates, beams straight. Nodes are composites, then beams
// (frame at the start, x along the beam); links are joints and the welds between a body and a beam.
// A spanning tree carries places outwards from each component's root; what is left over are loops,
// closed by changing the free coordinates as little as possible (Gauss-Newton, least squares).
//
// A link holds outer's frame, in inner's, at (sign travel, 0) turned by sign theta.
struct Link {
  std::string name;
  std::string where;
  int inner = -1, outer = -1;    // nodes
  PlanePose inner_in, outer_in;  // the link's frame in each node
  double sign = 1.0;             // +1 or -1 [-]
  bool turns = false;            // theta may change
  bool slides = false;           // travel may change
  // A drive gives the coordinate: closing the loops leaves it alone.
  bool theta_driven = false, travel_driven = false;
};

// Coordinates of all links, or their rates.
struct LinkCoordinates {
  std::vector<double> theta, travel;  // by link [rad], [m]
};

struct Placement {
  std::vector<PlanePose> node;      // by node
  LinkCoordinates at;               // closed values
  std::vector<PlanePose> velocity;  // by node: of its origin, and the angular one
};

class Assembly {
 public:
  // `parent`-less nodes are found by the order of `roots`, nodes that stand by themselves first.
  Assembly(int nodes, std::vector<Link> links, const std::vector<int>& root_order);

  // Roots of the components (each node's own), in order.
  int RootOf(int node) const { return root_[node]; }

  // `root_pose` and `root_velocity` by node (read at roots only); coordinates and rates by link.
  // Where a loop closes, rates of free coordinates change as little as possible too.
  // Throws Error naming the joints of a loop that cannot close.
  Placement Place(const std::vector<PlanePose>& root_pose,
                  const std::vector<PlanePose>& root_velocity, LinkCoordinates at,
                  LinkCoordinates rate) const;

 private:
  struct Unknown {  // a free coordinate that some loop passes
    int link;
    bool travel;
  };
  struct LoopSystem;

  void PlaceNodes(const std::vector<PlanePose>& root_pose, const LinkCoordinates& at,
                  std::vector<PlanePose>* node) const;
  void MoveNodes(const std::vector<PlanePose>& root_velocity, const LinkCoordinates& rate,
                 const LinkCoordinates& at, Placement* placement) const;
  LoopSystem FindLoops() const;
  void Linearise(const std::vector<PlanePose>& node, const LinkCoordinates& at,
                 LoopSystem* loops) const;
  void CloseLoops(const std::vector<PlanePose>& root_pose, LoopSystem* loops,
                  LinkCoordinates* at) const;
  void CloseRates(const std::vector<PlanePose>& root_velocity, LoopSystem* loops,
                  Placement* placement, LinkCoordinates* rate) const;
  [[noreturn]] void FailToClose(const LoopSystem& loops) const;
  // Tree links from a node to its root.
  std::vector<int> PathToRoot(int node) const;
  // Joints of the loop that a cut link closes.
  std::vector<int> LoopOf(int cut) const;

  std::vector<Link> links_;
  double size_ = 0.0;        // largest distance of a link from the middle of its node's [m]
  std::vector<int> root_;    // by node
  std::vector<int> parent_;  // tree link by node, -1 at roots
  std::vector<int> order_;   // nodes, parents first
  std::vector<int> cut_;     // links not in the tree
};

}  // namespace unfurl::sim
