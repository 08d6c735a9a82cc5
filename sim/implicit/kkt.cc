#include "sim/implicit/kkt.h"

#include <algorithm>
#include <map>

namespace unfurl::sim {

Saddle::Saddle(const RigidBodies& bodies, const Constraints& constraints, const Tangent& tangent,
               bool by_blocks)
    : n_(bodies.count), rows_(constraints.rows()), mass_(bodies.mass), inertia_(bodies.inertia) {
  for (int s = 0; s < n_; ++s) (bodies.IsDynamic(s) ? moving_ : still_).push_back(s);
  for (int r = 0; r < rows_; ++r) {
    if (constraints.IsActive(r)) {
      row_list_.push_back({r, constraints.InnerBody(r), constraints.OuterBody(r)});
    }
  }
  if (by_blocks) tree_ = TreeSaddle(bodies, constraints, tangent);
  if (tree_.applies()) return;
  // Unknowns: three of every body side by side, then the rows.
  const int size = 3 * n_ + rows_;
  std::vector<std::uint8_t> active(size, 0), is_row(size, 0);
  for (const int s : moving_) {
    for (int d = 0; d < 3; ++d) active[3 * s + d] = 1;
  }
  std::vector<SparseLdlt::Pair> pairs;
  std::map<std::pair<int, int>, int> place_of;
  const auto place = [&](int a, int b) {
    const auto [found, added] =
        place_of.emplace(std::minmax(a, b), static_cast<int>(place_of.size()));
    if (added) pairs.push_back({found->first.first, found->first.second, found->second});
    return found->second;
  };
  for (const int s : moving_) {
    diagonal_at_.push_back(
        {s, {place(3 * s, 3 * s + 1), place(3 * s, 3 * s + 2), place(3 * s + 1, 3 * s + 2)}});
  }
  for (std::size_t p = 0; p < tangent.pairs().size(); ++p) {
    const Tangent::Pair& pair = tangent.pairs()[p];
    if (pair.a < 0) continue;
    Scatter scatter{static_cast<int>(p), {}};
    for (int k = 0; k < 9; ++k) scatter.place[k] = place(3 * pair.a + k / 3, 3 * pair.b + k % 3);
    pair_at_.push_back(scatter);
  }
  for (const Row& r : row_list_) {
    const int row = 3 * n_ + r.row;
    active[row] = is_row[row] = 1;
    for (int d = 0; d < 3; ++d) {
      if (bodies.IsDynamic(r.inner)) {
        jacobian_at_.push_back({6 * r.row + d, place(row, 3 * r.inner + d)});
      }
      if (bodies.IsDynamic(r.outer)) {
        jacobian_at_.push_back({6 * r.row + 3 + d, place(row, 3 * r.outer + d)});
      }
    }
  }
  ldlt_ = SparseLdlt(size, active, pairs, static_cast<int>(pairs.size()), is_row);
  diagonal_ = inverse_ = x_ = Array(PaddedSize(size) + kBlock, 0.0);
  off_ = Array(PaddedSize(ldlt_.places()) + kBlock, 0.0);
}

void Saddle::Factor(const Tangent& tangent, const double* jacobian, double a, double b) {
  if (tree_.applies()) return tree_.Factor(tangent, jacobian, a, b);
  std::fill(off_.begin(), off_.end(), 0.0);
  std::fill(x_.begin(), x_.end(), 0.0);
  std::fill_n(diagonal_.begin() + 3 * n_, rows_, 0.0);
  for (const Scatter& at : diagonal_at_) {
    const int s = at.source;
    const Tangent::Block &k = tangent.K(s), &d = tangent.D(s);
    diagonal_[3 * s] = mass_[s] + a * d[0] + b * k[0];
    diagonal_[3 * s + 1] = mass_[s] + a * d[4] + b * k[4];
    diagonal_[3 * s + 2] = inertia_[s] + a * d[8] + b * k[8];
    off_[at.place[0]] = a * d[1] + b * k[1];
    off_[at.place[1]] = a * d[2] + b * k[2];
    off_[at.place[2]] = a * d[5] + b * k[5];
  }
  for (const Scatter& at : pair_at_) {
    const Tangent::Block &k = tangent.PairK(at.source), &d = tangent.PairD(at.source);
    for (int i = 0; i < 9; ++i) off_[at.place[i]] += a * d[i] + b * k[i];
  }
  for (const Entry& at : jacobian_at_) off_[at.place] += jacobian[at.source];
  ldlt_.FactorAndForward(diagonal_.data(), off_.data(), inverse_.data(), x_.data());
}

void Saddle::Solve(double* x, const double* g) {
  if (tree_.applies()) {
    tree_.Solve(x, g);
    for (const int s : still_) x[s] = x[n_ + s] = x[2 * n_ + s] = 0.0;
    return;
  }
  for (const int s : moving_) {
    for (int d = 0; d < 3; ++d) x_[3 * s + d] = x[d * n_ + s];
  }
  for (int r = 0; r < rows_; ++r) x_[3 * n_ + r] = g == nullptr ? 0.0 : g[r];
  ldlt_.Forward(off_.data(), inverse_.data(), x_.data());
  ldlt_.Backward(off_.data(), x_.data());
  std::fill_n(x, 3 * n_, 0.0);
  for (const int s : moving_) {
    for (int d = 0; d < 3; ++d) x[d * n_ + s] = x_[3 * s + d];
  }
}

void Saddle::JacobianTimes(const double* jacobian, const double* v, double* g) const {
  std::fill_n(g, rows_, 0.0);
  for (const Row& r : row_list_) {
    const double* j = jacobian + 6 * r.row;
    g[r.row] = j[0] * v[r.inner] + j[1] * v[n_ + r.inner] + j[2] * v[2 * n_ + r.inner] +
               j[3] * v[r.outer] + j[4] * v[n_ + r.outer] + j[5] * v[2 * n_ + r.outer];
  }
}

}  // namespace unfurl::sim
