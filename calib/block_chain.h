#pragma once

#include <Eigen/Core>
#include <vector>

namespace unfurl::calib {

/// A symmetric positive definite matrix of square blocks along the diagonal, each coupled with the
/// next one at most, and its inverse where that is asked for, in time that grows with the number of
/// blocks. [block tridiagonal elimination; selected inverse: Takahashi 1973]
class BlockChain {
 public:
  // `next[k]` couples block k (rows) with k + 1 (columns); without columns: they are not coupled.
  // One entry less than `diagonal`, or none at all.
  BlockChain(const std::vector<Eigen::MatrixXd>& diagonal, std::vector<Eigen::MatrixXd> next);

  // The solution for right-hand sides given block by block.
  std::vector<Eigen::MatrixXd> Solve(std::vector<Eigen::MatrixXd> right) const;
  // The blocks of the inverse on the diagonal.
  std::vector<Eigen::MatrixXd> InverseDiagonal() const;

 private:
  bool Coupled(std::size_t k) const { return k < next_.size() && next_[k].cols() > 0; }

  std::vector<Eigen::MatrixXd> pivot_;  // inverses of what elimination leaves of each block
  std::vector<Eigen::MatrixXd> next_;
};

}  // namespace unfurl::calib
