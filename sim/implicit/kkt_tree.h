#pragma once

#include <array>
#include <vector>

#include "sim/constraints/constraints.h"
#include "sim/implicit/tangent.h"

namespace unfurl::sim {

// The saddle-point system of an implicit step (sim/kkt.h) where the bodies' couplings form trees,
// by 3 x 3 blocks from the tips to the roots. A body c is eliminated with the rows between it and
// its parent p, which leaves a Schur complement on p: with P = W_c^-1, K = W_cp and J the rows,
//   G = J_p - J_c P K,  S = J_c P J_c^T,  W_p -= K^T P K - G^T S^-1 G:
// the articulated inertia, with elastic couplings. W_c is definite, so nothing needs pivoting, as
// long as the rows are independent on c alone; that is so unless a loop closes through the ground.
class TreeSaddle {
 public:
  TreeSaddle() = default;
  TreeSaddle(const RigidBodies& bodies, const Constraints& constraints, const Tangent& tangent);
  // Whether the scene's couplings are trees, each held to the ground at one body at most.
  bool applies() const { return applies_; }

  void Factor(const Tangent& tangent, const double* jacobian, double a, double b);
  void Solve(double* x, const double* g);

 private:
  static constexpr int kMostRows = 3;  // a weld's: x, y, theta
  struct Node {
    int body = -1, parent = -1;  // parent: index of a node, -1 for roots
    int rows = 0;
    std::array<int, kMostRows> row{};           // of the constraints
    std::array<int, kMostRows> own{}, other{};  // where J_c, J_p start in J; other -1: the ground
  };
  struct Numbers {
    double W[6];  // xx xy xt yy yt tt, then its inverse P [SI]
    double K[9];  // rows of c, columns of p [SI]
    double JP[kMostRows][3], G[kMostRows][3], S[6], SG[kMostRows][3];  // S: then its inverse [SI]
    double r[3], q[kMostRows];  // right sides, then solutions [SI]
  };
  struct Source {
    int node, pair;
    bool transposed;
  };
  template <int kRows>
  void Eliminate(const Node& node, const double* jacobian);

  bool applies_ = false;
  int n_ = 0;
  Array mass_, inertia_;     // [kg], [kg m^2]
  std::vector<Node> nodes_;  // tips first
  std::vector<Numbers> numbers_;
  std::vector<Source> sources_;
};

}  // namespace unfurl::sim
