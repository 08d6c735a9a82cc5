// Groups with shared errors against the same covariance as one dense matrix: every number of the
// joint test, and of a check of points.
#include "calib/whitening.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "base/random.h"
#include "calib/check_design.h"
#include "calib/joint_test.h"
#include "tests/calib/fixtures.h"

namespace unfurl::calib::whitening_test {
namespace {

// Of probabilities and squares: rounding of both ways, times the condition of the covariances here,
// at most 1e5 [-].
constexpr double kRounding = 1e-9;

Eigen::MatrixXd Draw(Eigen::Index rows, Eigen::Index columns, Rng* rng) {
  Eigen::MatrixXd out(rows, columns);
  for (double& x : out.reshaped()) x = rng->Normal();
  return out;
}

Eigen::MatrixXd DenseOf(const GroupedCovariance& covariance) {
  Eigen::MatrixXd out = covariance.shared * covariance.shared.transpose();
  Eigen::Index first = 0;
  for (const Eigen::MatrixXd& block : covariance.own) {
    out.block(first, first, block.rows(), block.rows()) += block;
    first += block.rows();
  }
  return out;
}

GroupedCovariance AsOne(const GroupedCovariance& covariance) {
  const Eigen::MatrixXd C = DenseOf(covariance);
  return {{C}, Eigen::MatrixXd(C.rows(), 0)};
}

// Groups of 1 to 5, `shared` errors that are `size` times the misfits' own.
GroupedCovariance Groups(int groups, Eigen::Index shared, double size, Rng* rng) {
  GroupedCovariance out;
  Eigen::Index n = 0;
  for (int g = 0; g < groups; ++g) {
    const Eigen::Index m = 1 + g % 5;
    const Eigen::MatrixXd root = Draw(m, m, rng);
    out.own.emplace_back(root * root.transpose() + 0.1 * Eigen::MatrixXd::Identity(m, m));
    n += m;
  }
  out.shared = size * Draw(n, shared, rng);
  return out;
}

TEST(Whitening, MakesErrorsIndependent) {
  Rng rng(21);
  // More shared errors than misfits, fewer, dependent ones, and none.
  for (const auto& [groups, shared, size] :
       {std::tuple{3, 12, 1.0}, {12, 4, 100.0}, {12, 4, 1e-3}, {7, 0, 1.0}}) {
    GroupedCovariance covariance = Groups(groups, shared, size, &rng);
    if (shared > 2) covariance.shared.col(1) = 2.0 * covariance.shared.col(0);
    const Whitening whitening(covariance);
    const Eigen::MatrixXd root = DenseOf(covariance).llt().matrixL();
    const Eigen::MatrixXd white = whitening.Whiten(root);
    const Eigen::Index n = whitening.size();
    EXPECT_LT((white * white.transpose() - Eigen::MatrixXd::Identity(n, n)).cwiseAbs().maxCoeff(),
              kRounding);
  }
}

// Effects on whole groups, on parts of them, on none, and with dependent columns.
TEST(Whitening, WithoutLocalEffectsIsWithoutThemInTheDense) {
  Rng rng(22);
  const GroupedCovariance covariance = Groups(30, 6, 10.0, &rng);
  const Whitening whitening(covariance), dense(AsOne(covariance));
  const Eigen::VectorXd e = Draw(whitening.size(), 1, &rng);
  const Eigen::VectorXd y = whitening.Whiten(e), y_dense = dense.Whiten(e);
  const Eigen::MatrixXd none(whitening.size(), 0);
  const auto against = whitening.MakeAgainst(y, none);
  EXPECT_NEAR(y.squaredNorm(), y_dense.squaredNorm(), kRounding * y.squaredNorm());
  std::vector<Effect> effects;
  Eigen::Index first = 0;
  for (const Eigen::MatrixXd& block : covariance.own) {
    effects.push_back({first, Draw(block.rows(), 3, &rng)});
    effects.back().rows.col(1) = -effects.back().rows.col(0);
    effects.push_back({first + block.rows() - 1, Draw(1, 1, &rng)});
    first += block.rows();
  }
  effects.push_back({0, Eigen::MatrixXd(0, 2)});
  std::vector<const Effect*> all;
  for (const Effect& effect : effects) {
    const Whitening::Rest rest = whitening.WithoutLocal(effect, against);
    const Eigen::MatrixXd Q = SpanOf(dense.Whiten(effect));
    EXPECT_EQ(rest.freed, Q.cols());
    const double expected = (y_dense - Q * (Q.transpose() * y_dense)).squaredNorm();
    EXPECT_NEAR(rest.square, expected, kRounding * y.squaredNorm());
    if (all.size() < 20) all.push_back(&effect);
    const Whitening::Rest many = whitening.WithoutMany({&effect}, e);
    EXPECT_EQ(many.freed, Q.cols());
    EXPECT_NEAR(many.square, expected, kRounding * y.squaredNorm());
  }
  Eigen::MatrixXd columns(whitening.size(), 0);
  for (const Effect* effect : all) {
    columns.conservativeResize(Eigen::NoChange, columns.cols() + effect->rows.cols());
    columns.rightCols(effect->rows.cols()) = dense.Whiten(*effect);
  }
  const Eigen::MatrixXd Q = SpanOf(columns);
  const Whitening::Rest many = whitening.WithoutMany(all, e);
  EXPECT_EQ(many.freed, Q.cols());
  EXPECT_NEAR(many.square, (y_dense - Q * (Q.transpose() * y_dense)).squaredNorm(),
              kRounding * y.squaredNorm());
}

// A check of sixty points with errors of the station and something wrong of each kind.
TEST(Whitening, ACheckIsTheOneOfTheDenseCovariance) {
  const testing::Study study = testing::MakeStudy(43);
  const data::Rig rig = FitRig(study.data, {}, "test").rig;
  const Observations whole = testing::Observe(
      study.truth, testing::PointsInCube(60, 0.7, Rng(9).Stream("points")), 3e-4, 0.05, Rng(9));
  const std::vector<std::size_t> match = MatchCameras(rig, whole, "test");
  for (int wrong = 0; wrong < 5; ++wrong) {
    Observations data = whole;
    data.common.push_back({"scale", "1", 1e-4, 1e-4 * data.p});
    if (wrong == 1) data.p.col(4) += Eigen::Vector3d(0.02, 0.0, 0.0);
    if (wrong == 2) data.readings[17].u_px += 3.0;
    if (wrong == 4) data.p.colwise() += Eigen::Vector3d(0.005, 0.0, 0.0);
    for (Reading& r : data.readings) r.u_px += wrong == 3 && r.camera == 1 ? 2.0 : 0.0;
    // A point that nobody saw.
    const int gone = data.readings[40].point;
    std::erase_if(data.readings, [&](const Reading& r) { return r.point == gone; });

    const CheckDesign design = DesignOfPoints(rig, data, match, "test");
    const GroupedCovariance one = AsOne(design.covariance);
    EXPECT_LT((design.covariance.Variances() - one.own[0].diagonal()).norm(),
              kRounding * one.own[0].diagonal().norm());
    const JointTest test(design.misfit, design.covariance), dense(design.misfit, one);
    const Eigen::MatrixXd shifts = design.Shifts(rig.cameras.size());
    EXPECT_NEAR(test.Chance(), dense.Chance(), kRounding);
    EXPECT_NEAR(test.ScanChance(shifts), dense.ScanChance(shifts), kRounding);
    const double shown = dense.ShownAmount(shifts, 1, 0.01);
    EXPECT_NEAR(test.ShownAmount(shifts, 1, 0.01), shown, kRounding * shown);
    const std::vector<double> each = test.ChancesWithout(design.by_point);
    const std::vector<double> each_dense = dense.ChancesWithout(design.by_point);
    for (std::size_t i = 0; i < each.size(); ++i) {
      EXPECT_NEAR(each[i], each_dense[i], kRounding);
    }
    std::vector<const Effect*> of_camera;
    for (std::size_t r = 0; r < design.camera.size(); ++r) {
      if (design.camera[r] == 2) of_camera.push_back(&design.by_reading[r]);
    }
    EXPECT_NEAR(test.ChanceWithoutAll(of_camera), dense.ChanceWithoutAll(of_camera), kRounding);

    const std::vector<Hypothesis> all = HypothesesOf(rig, design, {});
    bool explained = false, explained_dense = false;
    const auto found = test.FindCauses(all, 0.01, 3, &explained);
    const auto found_dense = dense.FindCauses(all, 0.01, 3, &explained_dense);
    EXPECT_EQ(explained, explained_dense);
    ASSERT_EQ(found.size(), found_dense.size());
    for (std::size_t k = 0; k < found.size(); ++k) {
      EXPECT_EQ(found[k].kind, found_dense[k].kind);
      EXPECT_EQ(found[k].index, found_dense[k].index);
      EXPECT_NEAR(found[k].probability, found_dense[k].probability, 1e-6);  // logs of 1e5 and more
      EXPECT_NEAR(found[k].other_probability, found_dense[k].other_probability, 1e-6);
    }
  }
}

}  // namespace
}  // namespace unfurl::calib::whitening_test
