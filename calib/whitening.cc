#include "calib/whitening.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "base/dense.h"

namespace unfurl::calib {

// Part of the largest that rounding leaves of a dependent column [-].
constexpr double kWhiteRank = 1e-9;

Eigen::VectorXd GroupedCovariance::Variances() const {
  Eigen::VectorXd out = shared.rowwise().squaredNorm();
  Eigen::Index first = 0;
  for (const Eigen::MatrixXd& block : own) {
    out.segment(first, block.rows()) += block.diagonal();
    first += block.rows();
  }
  return out;
}

Eigen::MatrixXd SpanOf(const Eigen::MatrixXd& W) {
  if (W.cols() == 0 || W.rows() == 0) return Eigen::MatrixXd::Zero(W.rows(), 0);
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(W);
  qr.setThreshold(kWhiteRank);
  return qr.householderQ() * Eigen::MatrixXd::Identity(W.rows(), qr.rank());
}

Whitening::Whitening(const GroupedCovariance& covariance) : shared_(covariance.shared) {
  for (const Eigen::MatrixXd& block : covariance.own) {
    const auto first = static_cast<Eigen::Index>(group_of_.size());
    group_of_.insert(group_of_.end(), static_cast<std::size_t>(block.rows()), groups_.size());
    groups_.push_back({first, block.llt().matrixL()});
    const Group& group = groups_.back();
    if (shared_.cols() == 0) continue;
    group.root.triangularView<Eigen::Lower>().solveInPlace(shared_.middleRows(first, block.rows()));
  }
  assert(shared_.rows() == size());
  basis_.resize(size(), 0);
  if (size() == 0 || shared_.cols() == 0) return;
  // The singular vectors of a tall matrix are those of its triangle, turned by Q of its QR.
  const Eigen::Index rank = std::min(shared_.rows(), shared_.cols());
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(shared_);
  const Eigen::MatrixXd R = qr.matrixQR().topRows(rank).triangularView<Eigen::Upper>();
  const Eigen::BDCSVD<Eigen::MatrixXd> svd(R, Eigen::ComputeThinU);
  basis_.setZero(size(), rank);
  basis_.topRows(rank) = svd.matrixU();
  basis_.applyOnTheLeft(qr.householderQ());
  drop_ = svd.singularValues().unaryExpr([](double s) { return 1.0 - 1.0 / std::hypot(1.0, s); });
}

Eigen::MatrixXd Whitening::Own(const Group& group, const Effect& effect) const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(group.root.rows(), effect.rows.cols());
  out.middleRows(effect.first - group.first, effect.rows.rows()) = effect.rows;
  group.root.triangularView<Eigen::Lower>().solveInPlace(out);
  return out;
}

Eigen::MatrixXd Whitening::Whiten(const Eigen::Ref<const Eigen::MatrixXd>& columns) const {
  Eigen::MatrixXd out = columns;
  for (const Group& group : groups_) {
    group.root.triangularView<Eigen::Lower>().solveInPlace(
        out.middleRows(group.first, group.root.rows()));
  }
  if (drop_.size() > 0) out -= basis_ * (drop_.asDiagonal() * (basis_.transpose() * out)).eval();
  return out;
}

Eigen::MatrixXd Whitening::Whiten(const Effect& effect) const {
  Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(size(), effect.rows.cols());
  whole.middleRows(effect.first, effect.rows.rows()) = effect.rows;
  return Whiten(whole);
}

bool Whitening::IsLocal(const Effect& effect) const {
  const Eigen::Index last = effect.first + effect.rows.rows() - 1;
  return last < effect.first || group_of_[static_cast<std::size_t>(effect.first)] ==
                                    group_of_[static_cast<std::size_t>(last)];
}

Whitening::Against Whitening::MakeAgainst(const Eigen::VectorXd& y,
                                          const Eigen::MatrixXd& P) const {
  return {y, P, y.squaredNorm(), basis_.transpose() * y, basis_.transpose() * P};
}

Whitening::Products Whitening::ProductsOf(const Effect& effect, const Against& against) const {
  const Eigen::Index k = effect.rows.cols();
  if (effect.rows.rows() == 0) return {Eigen::MatrixXd::Zero(k, k), Eigen::VectorXd::Zero(k)};
  const Group& group = groups_[group_of_[static_cast<std::size_t>(effect.first)]];
  const Eigen::Index m = group.root.rows();
  const Eigen::MatrixXd own = Own(group, effect);
  // E = own - Q c, so that E^T E = own^T own - q^T (2 d - d^2) q with q = Q^T own and c = d q.
  const Eigen::MatrixXd q = basis_.middleRows(group.first, m).transpose() * own;
  const Eigen::MatrixXd c = drop_.asDiagonal() * q;
  const Eigen::VectorXd share = (2.0 - drop_.array()) * drop_.array();
  Products out;
  out.gram = own.transpose() * own - q.transpose() * share.asDiagonal() * q;
  out.whole = out.gram.trace();
  out.along =
      own.transpose() * against.y.segment(group.first, m) - c.transpose() * against.shared_y;
  if (against.P.cols() > 0) {
    const Eigen::MatrixXd beside =
        against.P.middleRows(group.first, m).transpose() * own - against.shared_P.transpose() * c;
    out.gram -= beside.transpose() * beside;
  }
  return out;
}

Whitening::Rest Whitening::WithoutLocal(const Effect& effect, const Against& against) const {
  Rest out{against.square, 0};
  if (effect.rows.rows() == 0) return out;
  const Group& group = groups_[group_of_[static_cast<std::size_t>(effect.first)]];
  // What it spans, as misfits whose own errors are independent: its gram is then 1 but for what is
  // shared.
  const Eigen::MatrixXd span = SpanOf(Own(group, effect));
  out.freed = span.cols();
  if (out.freed == 0) return out;
  const Products products =
      ProductsOf({group.first, group.root.triangularView<Eigen::Lower>() * span}, against);
  out.square -= products.along.dot(products.gram.llt().solve(products.along));
  return out;
}

Whitening::Rest Whitening::WithoutMany(const std::vector<const Effect*>& effects,
                                       const Eigen::VectorXd& e) const {
  Eigen::MatrixXd y = e;  // one column; clang-tidy sees a leak in Eigen's solver of a vector
  for (const Group& group : groups_) {
    group.root.triangularView<Eigen::Lower>().solveInPlace(
        y.middleRows(group.first, group.root.rows()));
  }
  Eigen::MatrixXd V = shared_;
  std::vector<std::vector<const Effect*>> of_group(groups_.size());
  for (const Effect* effect : effects) {
    if (effect->rows.rows() == 0) continue;
    of_group[group_of_[static_cast<std::size_t>(effect->first)]].push_back(effect);
  }
  Rest out;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    if (of_group[g].empty()) continue;
    const Eigen::Index first = groups_[g].first, m = groups_[g].root.rows();
    Eigen::MatrixXd columns(m, 0);
    for (const Effect* effect : of_group[g]) {
      const Eigen::Index before = columns.cols();
      columns.conservativeResize(Eigen::NoChange, before + effect->rows.cols());
      columns.rightCols(effect->rows.cols()) = Own(groups_[g], *effect);
    }
    const Eigen::MatrixXd span = SpanOf(columns);
    out.freed += span.cols();
    y.middleRows(first, m) -= span * (span.transpose() * y.middleRows(first, m)).eval();
    V.middleRows(first, m) -= span * (span.transpose() * V.middleRows(first, m)).eval();
  }
  // y^T (1 + V V^T)^-1 y is the least of |y - V z|^2 + |z|^2, which an error of z hardly changes.
  Eigen::MatrixXd A = V.transpose() * V;
  A.diagonal().array() += 1.0;
  const Eigen::MatrixXd z = A.llt().solve(V.transpose() * y);
  out.square = (y - V * z).squaredNorm() + z.squaredNorm();
  return out;
}

}  // namespace unfurl::calib
