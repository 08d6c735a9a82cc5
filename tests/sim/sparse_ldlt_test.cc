#include "sim/constraints/sparse_ldlt.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <set>

#include "base/random.h"

namespace unfurl::sim::sparse_ldlt_test {
namespace {

// Rounding of solves with condition numbers up to some 1e3.
constexpr double kTolerance = 1e-11;

struct Problem {
  Eigen::MatrixXd A;
  std::vector<SparseLdlt::Pair> pairs;
  std::vector<double> diagonal, off;
};

// A diagonally dominant matrix on the given graph.
Problem MakeProblem(int n, const std::set<std::pair<int, int>>& edges, Rng* rng) {
  Problem p;
  p.A = Eigen::MatrixXd::Zero(n, n);
  for (const auto& [a, b] : edges) {
    const double v = rng->Uniform(-1.0, 1.0);
    p.A(a, b) = p.A(b, a) = v;
    p.pairs.push_back({a, b, static_cast<int>(p.off.size())});
    p.off.push_back(v);
  }
  for (int i = 0; i < n; ++i) p.A(i, i) = p.A.row(i).cwiseAbs().sum() + rng->Uniform(0.01, 1.0);
  for (int i = 0; i < n; ++i) p.diagonal.push_back(p.A(i, i));
  return p;
}

void ExpectSolves(Problem p, Rng* rng) {
  const int n = static_cast<int>(p.diagonal.size());
  const SparseLdlt ldlt(n, std::vector<std::uint8_t>(n, 1), p.pairs,
                        static_cast<int>(p.off.size()));
  p.off.resize(ldlt.places(), 0.0);
  std::vector<double> inverse(n), x(n), second(n);
  for (double& v : x) v = rng->Normal();
  for (double& v : second) v = rng->Normal();
  const Eigen::Map<Eigen::VectorXd> b(x.data(), n), b2(second.data(), n);
  const Eigen::VectorXd expected = p.A.llt().solve(b), expected2 = p.A.llt().solve(b2);
  ldlt.FactorAndForward(p.diagonal.data(), p.off.data(), inverse.data(), x.data());
  ldlt.Backward(p.off.data(), x.data());
  EXPECT_LT((b - expected).cwiseAbs().maxCoeff(), kTolerance);
  ldlt.Forward(p.off.data(), inverse.data(), second.data());
  ldlt.Backward(p.off.data(), second.data());
  EXPECT_LT((b2 - expected2).cwiseAbs().maxCoeff(), kTolerance);
}

TEST(SparseLdlt, RandomGraphsAgreeWithDenseCholesky) {
  Rng rng(2);
  for (int trial = 0; trial < 40; ++trial) {
    const int n = 2 + static_cast<int>(rng.Integer(40));
    std::set<std::pair<int, int>> edges;
    for (int k = 0; k < 2 * n; ++k) {
      const int a = static_cast<int>(rng.Integer(n)), b = static_cast<int>(rng.Integer(n));
      if (a != b) edges.insert({std::min(a, b), std::max(a, b)});
    }
    ExpectSolves(MakeProblem(n, edges, &rng), &rng);
  }
}

TEST(SparseLdlt, ChainsAndTreesHaveNoFill) {
  Rng rng(3);
  constexpr int kRows = 2000;
  std::set<std::pair<int, int>> chain, tree;
  for (int i = 1; i < kRows; ++i) {
    chain.insert({i - 1, i});
    tree.insert({static_cast<int>(rng.Integer(i)), i});
  }
  for (const auto& edges : {chain, tree}) {
    const Problem p = MakeProblem(kRows, edges, &rng);
    const SparseLdlt ldlt(kRows, std::vector<std::uint8_t>(kRows, 1), p.pairs, kRows - 1);
    EXPECT_EQ(ldlt.nonzeros(), kRows - 1);
    EXPECT_EQ(ldlt.places(), kRows - 1);
  }
}

TEST(SparseLdlt, RingsHaveFillOfTheirLength) {
  Rng rng(4);
  constexpr int kRows = 500;
  std::set<std::pair<int, int>> ring{{0, kRows - 1}};
  for (int i = 1; i < kRows; ++i) ring.insert({i - 1, i});
  const Problem p = MakeProblem(kRows, ring, &rng);
  const SparseLdlt ldlt(kRows, std::vector<std::uint8_t>(kRows, 1), p.pairs, kRows);
  EXPECT_LE(ldlt.nonzeros(), 2 * kRows);
  ExpectSolves(p, &rng);
}

TEST(SparseLdlt, RowsWithoutEquationAreLeftAlone) {
  // Rows 1 and 3 hold nothing; the others are a chain 0 - 2 - 4.
  const SparseLdlt ldlt(5, {1, 0, 1, 0, 1}, {{0, 2, 0}, {2, 4, 1}}, 2);
  EXPECT_EQ(ldlt.size(), 3);
  std::vector<double> diagonal = {2, 7, 2, 7, 2}, off = {-1, -1}, inverse(5, 0.0),
                      x = {1, 9, 0, 9, 0};
  ldlt.FactorAndForward(diagonal.data(), off.data(), inverse.data(), x.data());
  ldlt.Backward(off.data(), x.data());
  EXPECT_NEAR(x[0], 0.75, kTolerance);
  EXPECT_NEAR(x[2], 0.5, kTolerance);
  EXPECT_NEAR(x[4], 0.25, kTolerance);
  EXPECT_EQ(x[1], 9);
  EXPECT_EQ(x[3], 9);
}

}  // namespace
}  // namespace unfurl::sim::sparse_ldlt_test
