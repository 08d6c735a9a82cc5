#include "sim/implicit/kkt_tree.h"

#include <algorithm>

namespace unfurl::sim {

namespace {

// The bodies as a graph, whose edges are constraints and elastic couplings; and as trees, if it is
// a forest.
struct CouplingTrees {
  struct Link {
    int other, row;  // row: of the constraints, -1 for an elastic coupling
  };

  explicit CouplingTrees(int bodies)
      : at(bodies), ground_rows(bodies), parent(bodies, -1), seen(bodies, 0) {}

  // False where a row couples two bodies that cannot move.
  bool Connect(const RigidBodies& bodies, const Constraints& constraints, const Tangent& tangent) {
    for (int r = 0; r < constraints.rows(); ++r) {
      if (!constraints.IsActive(r)) continue;
      const int a = constraints.InnerBody(r), b = constraints.OuterBody(r);
      const bool first = bodies.IsDynamic(a), second = bodies.IsDynamic(b);
      if (first && second) {
        at[a].push_back({b, r});
        at[b].push_back({a, r});
      } else if (first || second) {
        ground_rows[first ? a : b].push_back(r);
      } else {
        return false;
      }
    }
    for (const Tangent::Pair& pair : tangent.pairs()) {
      if (pair.a < 0) continue;
      at[pair.a].push_back({pair.b, -1});
      at[pair.b].push_back({pair.a, -1});
    }
    return true;
  }

  // Breadth first from a root; false at a loop, or where the ground holds another body too.
  bool Grow(int root) {
    seen[root] = 1;
    order.push_back(root);
    for (std::size_t k = order.size() - 1; k < order.size(); ++k) {
      const int s = order[k];
      if (s != root && !ground_rows[s].empty()) return false;
      for (const Link& link : at[s]) {
        if (link.other == parent[s]) continue;
        if (!seen[link.other]) {
          seen[link.other] = 1;
          parent[link.other] = s;
          order.push_back(link.other);
        } else if (parent[link.other] != s) {
          return false;
        }
      }
    }
    return true;
  }

  // Trees outwards from the bodies that the ground holds, then from what is left: of a free
  // component the body with the most neighbours, so that its branches can be worked on in turn.
  bool GrowAll(const RigidBodies& bodies, std::size_t most_rows) {
    std::vector<int> roots;
    for (int s = 0; s < bodies.count; ++s) {
      if (bodies.IsDynamic(s)) roots.push_back(s);
    }
    std::stable_sort(roots.begin(), roots.end(), [&](int a, int b) {
      if (ground_rows[a].empty() != ground_rows[b].empty()) return !ground_rows[a].empty();
      return at[a].size() > at[b].size();
    });
    for (const int root : roots) {
      if (seen[root]) continue;
      if (ground_rows[root].size() > most_rows || !Grow(root)) return false;
    }
    return true;
  }

  // Orders the bodies by their height above the tips, the order of elimination.
  void TipsFirst() {
    std::vector<int> height(at.size(), 0);
    for (auto s = order.rbegin(); s != order.rend(); ++s) {
      if (parent[*s] >= 0) height[parent[*s]] = std::max(height[parent[*s]], height[*s] + 1);
    }
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return height[a] < height[b]; });
  }

  // Rows between a body and its parent, or the ground for a root.
  std::vector<int> RowsOf(int s) const {
    std::vector<int> rows = ground_rows[s];
    for (const Link& link : at[s]) {
      if (link.row >= 0 && link.other == parent[s]) rows.push_back(link.row);
    }
    return rows;
  }

  std::vector<std::vector<Link>> at;          // by body
  std::vector<std::vector<int>> ground_rows;  // by body
  std::vector<int> parent, order;             // parent: by body, -1 for roots
  std::vector<char> seen;
};

}  // namespace

TreeSaddle::TreeSaddle(const RigidBodies& bodies, const Constraints& constraints,
                       const Tangent& tangent)
    : n_(bodies.count), mass_(bodies.mass), inertia_(bodies.inertia) {
  CouplingTrees trees(n_);
  if (!trees.Connect(bodies, constraints, tangent) || !trees.GrowAll(bodies, kMostRows)) return;
  trees.TipsFirst();
  std::vector<int> node_of(n_, -1);
  for (std::size_t k = 0; k < trees.order.size(); ++k) {
    node_of[trees.order[k]] = static_cast<int>(k);
  }
  for (const int s : trees.order) {
    const std::vector<int> rows = trees.RowsOf(s);
    if (rows.size() > kMostRows) return;
    Node node;
    node.body = s;
    node.parent = trees.parent[s] < 0 ? -1 : node_of[trees.parent[s]];
    for (const int r : rows) {
      const bool inner = constraints.InnerBody(r) == s;
      node.row[node.rows] = r;
      node.own[node.rows] = 6 * r + (inner ? 0 : 3);
      node.other[node.rows] = node.parent < 0 ? -1 : 6 * r + (inner ? 3 : 0);
      ++node.rows;
    }
    nodes_.push_back(node);
  }
  for (std::size_t p = 0; p < tangent.pairs().size(); ++p) {
    const Tangent::Pair& pair = tangent.pairs()[p];
    if (pair.a < 0) continue;
    const bool forward = trees.parent[pair.a] == pair.b;  // a is the child
    sources_.push_back({node_of[forward ? pair.a : pair.b], static_cast<int>(p), !forward});
  }
  numbers_.assign(nodes_.size(), Numbers{});
  applies_ = true;
}

namespace {

// Inverse of a symmetric 3 x 3 matrix (xx xy xz yy yz zz), by cofactors.
inline void Invert(double* m) {
  const double a = m[0], b = m[1], c = m[2], d = m[3], e = m[4], f = m[5];
  const double A = d * f - e * e, B = c * e - b * f, C = b * e - c * d;
  const double scale = 1.0 / (a * A + b * B + c * C);
  m[0] = A * scale;
  m[1] = B * scale;
  m[2] = C * scale;
  m[3] = (a * f - c * c) * scale;
  m[4] = (b * c - a * e) * scale;
  m[5] = (a * d - b * b) * scale;
}

inline void Times(const double* P, const double* v, double* out) {
  out[0] = P[0] * v[0] + P[1] * v[1] + P[2] * v[2];
  out[1] = P[1] * v[0] + P[3] * v[1] + P[4] * v[2];
  out[2] = P[2] * v[0] + P[4] * v[1] + P[5] * v[2];
}

inline double Dot(const double* a, const double* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// S^-1 v for the rows between two bodies.
template <int kRows>
inline void RowsTimes(const double* S, const double* v, double* out) {
  if constexpr (kRows == 1) {
    out[0] = S[0] * v[0];
  } else if constexpr (kRows == 2) {
    out[0] = S[0] * v[0] + S[1] * v[1];
    out[1] = S[1] * v[0] + S[2] * v[1];
  } else if constexpr (kRows == 3) {
    Times(S, v, out);
  }
}

}  // namespace

template <int kRows>
void TreeSaddle::Eliminate(const Node& node, const double* jacobian) {
  Numbers& c = numbers_[&node - nodes_.data()];
  Invert(c.W);
  const double* P = c.W;
  for (int i = 0; i < kRows; ++i) Times(P, jacobian + node.own[i], c.JP[i]);
  if constexpr (kRows == 1) {
    c.S[0] = 1.0 / Dot(c.JP[0], jacobian + node.own[0]);
  } else if constexpr (kRows == 2) {
    const double a = Dot(c.JP[0], jacobian + node.own[0]);
    const double b = Dot(c.JP[0], jacobian + node.own[1]);
    const double d = Dot(c.JP[1], jacobian + node.own[1]);
    const double scale = 1.0 / (a * d - b * b);
    c.S[0] = d * scale;
    c.S[1] = -b * scale;
    c.S[2] = a * scale;
  } else if constexpr (kRows == 3) {
    for (int i = 0, k = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j) c.S[k++] = Dot(c.JP[i], jacobian + node.own[j]);
    }
    Invert(c.S);
  }
  if (node.parent < 0) return;
  Numbers& p = numbers_[node.parent];
  const double* K = c.K;
  // Columns of P K, then K^T (P K).
  double U[3][3];
  for (int j = 0; j < 3; ++j) {
    const double column[3] = {K[j], K[3 + j], K[6 + j]};
    Times(P, column, U[j]);
  }
  double dW[6];
  for (int i = 0, k = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j, ++k)
      dW[k] = K[i] * U[j][0] + K[3 + i] * U[j][1] + K[6 + i] * U[j][2];
  }
  if constexpr (kRows > 0) {
    for (int i = 0; i < kRows; ++i) {
      const double* other = jacobian + node.other[i];
      const double* v = c.JP[i];
      for (int j = 0; j < 3; ++j) {
        c.G[i][j] = other[j] - (v[0] * K[j] + v[1] * K[3 + j] + v[2] * K[6 + j]);
      }
    }
    for (int j = 0; j < 3; ++j) {
      double g[kRows], sg[kRows];
      for (int i = 0; i < kRows; ++i) g[i] = c.G[i][j];
      RowsTimes<kRows>(c.S, g, sg);
      for (int i = 0; i < kRows; ++i) c.SG[i][j] = sg[i];
    }
    for (int i = 0, k = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j, ++k) {
        for (int r = 0; r < kRows; ++r) dW[k] -= c.G[r][i] * c.SG[r][j];
      }
    }
  }
  for (int k = 0; k < 6; ++k) p.W[k] -= dW[k];
}

void TreeSaddle::Factor(const Tangent& tangent, const double* jacobian, double a, double b) {
  constexpr int kUpper[6] = {0, 1, 2, 4, 5, 8};
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const int s = nodes_[i].body;
    const Tangent::Block &k = tangent.K(s), &d = tangent.D(s);
    Numbers& c = numbers_[i];
    for (int j = 0; j < 6; ++j) c.W[j] = a * d[kUpper[j]] + b * k[kUpper[j]];
    c.W[0] += mass_[s];
    c.W[3] += mass_[s];
    c.W[5] += inertia_[s];
    for (double& v : c.K) v = 0.0;
  }
  for (const Source& source : sources_) {
    const Tangent::Block &k = tangent.PairK(source.pair), &d = tangent.PairD(source.pair);
    double* K = numbers_[source.node].K;
    if (source.transposed) {
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) K[3 * i + j] += a * d[3 * j + i] + b * k[3 * j + i];
      }
    } else {
      for (int i = 0; i < 9; ++i) K[i] += a * d[i] + b * k[i];
    }
  }
  for (const Node& node : nodes_) {
    switch (node.rows) {
      case 0:
        Eliminate<0>(node, jacobian);
        break;
      case 1:
        Eliminate<1>(node, jacobian);
        break;
      case 2:
        Eliminate<2>(node, jacobian);
        break;
      default:
        Eliminate<3>(node, jacobian);
        break;
    }
  }
}

namespace {

inline void MultiplyRows(int rows, const double* S, const double* v, double* out) {
  if (rows == 1) {
    RowsTimes<1>(S, v, out);
  } else if (rows == 2) {
    RowsTimes<2>(S, v, out);
  } else if (rows == 3) {
    RowsTimes<3>(S, v, out);
  }
}

}  // namespace

void TreeSaddle::Solve(double* x, const double* g) {
  const int n = n_;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    Numbers& c = numbers_[i];
    const int s = node.body;
    // x holds r; children have subtracted theirs already.
    const double r[3] = {x[s], x[n + s], x[2 * n + s]};
    for (int k = 0; k < 3; ++k) c.r[k] = r[k];
    for (int k = 0; k < node.rows; ++k) {
      c.q[k] = (g == nullptr ? 0.0 : g[node.row[k]]) - Dot(c.JP[k], r);
    }
    if (node.parent < 0) continue;
    double u[3];
    Times(c.W, r, u);
    const int p = nodes_[node.parent].body;
    double out[3];
    for (int j = 0; j < 3; ++j) out[j] = -(c.K[j] * u[0] + c.K[3 + j] * u[1] + c.K[6 + j] * u[2]);
    for (int k = 0; k < node.rows; ++k) {
      for (int j = 0; j < 3; ++j) out[j] += c.SG[k][j] * c.q[k];
    }
    x[p] += out[0];
    x[n + p] += out[1];
    x[2 * n + p] += out[2];
  }
  for (std::size_t i = nodes_.size(); i-- > 0;) {
    const Node& node = nodes_[i];
    const Numbers& c = numbers_[i];
    double r[3] = {c.r[0], c.r[1], c.r[2]};
    double q[kMostRows] = {c.q[0], c.q[1], c.q[2]};
    if (node.parent >= 0) {
      const int p = nodes_[node.parent].body;
      const double xp[3] = {x[p], x[n + p], x[2 * n + p]};
      for (int j = 0; j < 3; ++j) r[j] -= Dot(c.K + 3 * j, xp);
      for (int k = 0; k < node.rows; ++k) q[k] -= Dot(c.G[k], xp);
    }
    double u[3];
    Times(c.W, r, u);
    if (node.rows > 0) {
      double mu[kMostRows];
      MultiplyRows(node.rows, c.S, q, mu);  // minus the multipliers
      for (int k = 0; k < node.rows; ++k) {
        for (int j = 0; j < 3; ++j) u[j] += c.JP[k][j] * mu[k];
      }
    }
    const int s = node.body;
    x[s] = u[0];
    x[n + s] = u[1];
    x[2 * n + s] = u[2];
  }
}

}  // namespace unfurl::sim
