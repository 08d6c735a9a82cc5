#include "calib/block_chain.h"

#include <utility>

#include "base/dense.h"

namespace unfurl::calib {
namespace {

// Inverse of a positive definite block, scaled to a unit diagonal first: metres and metres per
// second differ by decades.
Eigen::MatrixXd InverseOf(const Eigen::MatrixXd& block) {
  const Eigen::VectorXd scale = block.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * block * scale.asDiagonal();
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(block.rows(), block.cols());
  return scale.asDiagonal() * Eigen::LLT<Eigen::MatrixXd>(scaled).solve(one) * scale.asDiagonal();
}

}  // namespace

BlockChain::BlockChain(const std::vector<Eigen::MatrixXd>& diagonal,
                       std::vector<Eigen::MatrixXd> next)
    : next_(std::move(next)) {
  for (std::size_t k = 0; k < diagonal.size(); ++k) {
    if (k > 0 && Coupled(k - 1)) {
      pivot_.push_back(
          InverseOf(diagonal[k] - next_[k - 1].transpose() * pivot_[k - 1] * next_[k - 1]));
    } else {
      pivot_.push_back(InverseOf(diagonal[k]));
    }
  }
}

std::vector<Eigen::MatrixXd> BlockChain::Solve(std::vector<Eigen::MatrixXd> right) const {
  for (std::size_t k = 1; k < right.size(); ++k) {
    if (Coupled(k - 1)) right[k] -= next_[k - 1].transpose() * (pivot_[k - 1] * right[k - 1]);
  }
  for (std::size_t k = right.size(); k-- > 0;) {
    if (Coupled(k)) right[k] -= next_[k] * right[k + 1];
    right[k] = pivot_[k] * right[k];
  }
  return right;
}

std::vector<Eigen::MatrixXd> BlockChain::InverseDiagonal() const {
  std::vector<Eigen::MatrixXd> out = pivot_;
  for (std::size_t k = out.size(); k-- > 0;) {
    if (!Coupled(k)) continue;
    const Eigen::MatrixXd back = pivot_[k] * next_[k];
    out[k] += back * out[k + 1] * back.transpose();
  }
  return out;
}

}  // namespace unfurl::calib
