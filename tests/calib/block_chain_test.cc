#include "calib/block_chain.h"

#include <gtest/gtest.h>

#include <vector>

#include "base/dense.h"
#include "base/random.h"

namespace unfurl::calib::block_chain_test {
namespace {

// Against a dense inverse, with links and without.
TEST(BlockChain, IsTheDenseInverse) {
  Rng rng(3);
  const auto random = [&](Eigen::Index rows, Eigen::Index cols) {
    return Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return rng.Normal(); }).eval();
  };
  const std::vector<Eigen::Index> sizes = {3, 5, 5, 2};
  const std::vector<Eigen::Index> first = {0, 3, 8, 13};
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(15, 15);
  std::vector<Eigen::MatrixXd> diagonal, next(3), right;
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::MatrixXd root = random(sizes[k], sizes[k]);
    diagonal.emplace_back(root * root.transpose() +
                          10.0 * Eigen::MatrixXd::Identity(sizes[k], sizes[k]));
    dense.block(first[k], first[k], sizes[k], sizes[k]) = diagonal[k];
    right.push_back(random(sizes[k], 2));
    if (k == 0 || k == 2) continue;  // blocks 1 and 2 are not linked
    next[k - 1] = random(sizes[k - 1], sizes[k]);
    dense.block(first[k - 1], first[k], sizes[k - 1], sizes[k]) = next[k - 1];
    dense.block(first[k], first[k - 1], sizes[k], sizes[k - 1]) = next[k - 1].transpose();
  }
  const BlockChain chain(diagonal, next);
  const Eigen::MatrixXd inverse = dense.inverse();
  Eigen::MatrixXd all(15, 2);
  for (std::size_t k = 0; k < 4; ++k) all.middleRows(first[k], sizes[k]) = right[k];
  const Eigen::MatrixXd expected = inverse * all;
  const std::vector<Eigen::MatrixXd> solved = chain.Solve(right);
  const std::vector<Eigen::MatrixXd> blocks = chain.InverseDiagonal();
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_LT((solved[k] - expected.middleRows(first[k], sizes[k])).norm(), 1e-12);
    EXPECT_LT((blocks[k] - inverse.block(first[k], first[k], sizes[k], sizes[k])).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace unfurl::calib::block_chain_test
