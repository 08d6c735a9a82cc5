#include "sim/implicit/kkt.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "base/random.h"
#include "scenes.h"
#include "sim/dynamics/dynamics.h"

namespace unfurl::sim::kkt_test {
namespace {

// A definite matrix of condition 1e5 or so; rounding times that, and to spare.
constexpr double kTolerance = 1e-9;

// Both eliminations against a dense solution, with random right sides, in the midst of a motion.
void ExpectSolves(const Model& model, bool tree) {
  Rng rng(3);
  const int n = model.rigid_bodies.count, rows = model.constraints.rows();
  std::vector<double> y = model.initial_state, rate(y.size());
  for (int s = 0; s < n; ++s) {
    if (!model.rigid_bodies.IsDynamic(s)) continue;
    for (int d = 0; d < 3; ++d) y[d * n + s] += 0.01 * rng.Normal();
    for (int d = 3; d < 6; ++d) y[d * n + s] = rng.Normal();
  }
  Dynamics dynamics(model);
  dynamics.RightSide(0.0, y.data(), rate.data());
  Tangent tangent;
  const Array lambda = dynamics.constraint_work().lambda;
  dynamics.FillTangent(0.0, y.data(), lambda.data(), &tangent);
  std::vector<double> J(6 * rows);
  model.constraints.Jacobian(dynamics.MotionAt(0.0, y.data()), dynamics.constraint_work(),
                             J.data());
  const double h = 1e-4, a = h, b = h * h;

  std::vector<int> row_of(rows, -1);
  int active = 0;
  for (int r = 0; r < rows; ++r) {
    if (model.constraints.IsActive(r)) row_of[r] = 3 * n + active++;
  }
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(3 * n + active, 3 * n + active);
  const auto add = [&](int p, int q, const Tangent::Block& k, const Tangent::Block& d) {
    for (int i = 0; i < 9; ++i) {
      const double v = a * d[i] + b * k[i];
      A(i / 3 * n + p, i % 3 * n + q) += v;
      if (p != q) A(i % 3 * n + q, i / 3 * n + p) += v;
    }
  };
  for (int s = 0; s < n; ++s) {
    if (!model.rigid_bodies.IsDynamic(s)) {
      for (int d = 0; d < 3; ++d) A(d * n + s, d * n + s) = 1.0;
      continue;
    }
    add(s, s, tangent.K(s), tangent.D(s));
    A(s, s) += model.rigid_bodies.mass[s];
    A(n + s, n + s) += model.rigid_bodies.mass[s];
    A(2 * n + s, 2 * n + s) += model.rigid_bodies.inertia[s];
  }
  for (std::size_t p = 0; p < tangent.pairs().size(); ++p) {
    const Tangent::Pair& pair = tangent.pairs()[p];
    if (pair.a >= 0) add(pair.a, pair.b, tangent.PairK(p), tangent.PairD(p));
  }
  for (int r = 0; r < rows; ++r) {
    if (row_of[r] < 0) continue;
    for (int k = 0; k < 6; ++k) {
      const int body = k < 3 ? model.constraints.InnerBody(r) : model.constraints.OuterBody(r);
      if (!model.rigid_bodies.IsDynamic(body)) continue;
      A(row_of[r], k % 3 * n + body) += J[6 * r + k];
      A(k % 3 * n + body, row_of[r]) += J[6 * r + k];
    }
  }
  Eigen::VectorXd right = Eigen::VectorXd::Zero(3 * n + active);
  std::vector<double> x(3 * n), g(rows, 0.0);
  for (int s = 0; s < n; ++s) {
    for (int d = 0; d < 3 && model.rigid_bodies.IsDynamic(s); ++d) x[d * n + s] = rng.Normal();
  }
  for (int k = 0; k < 3 * n; ++k) right[k] = x[k];
  for (int r = 0; r < rows; ++r) {
    if (row_of[r] >= 0) right[row_of[r]] = g[r] = rng.Normal();
  }
  const Eigen::VectorXd dense = A.fullPivLu().solve(right);
  const double scale = dense.head(3 * n).cwiseAbs().maxCoeff();
  for (const bool by_blocks : {false, true}) {
    if (by_blocks && !tree) continue;
    Saddle saddle(model.rigid_bodies, model.constraints, tangent, by_blocks);
    EXPECT_EQ(saddle.by_blocks(), by_blocks);
    saddle.Factor(tangent, J.data(), a, b);
    for (int repeat = 0; repeat < 2; ++repeat) {
      std::vector<double> ours = x, rows_given = g;
      saddle.Solve(ours.data(), rows_given.data());
      double worst = 0.0;
      for (int k = 0; k < 3 * n; ++k) worst = std::max(worst, std::fabs(ours[k] - dense[k]));
      EXPECT_LT(worst / scale, kTolerance) << (by_blocks ? "by blocks" : "by entries");
    }
  }
}

Model Deployment(bool elastic, double beta) {
  data::Scene scene = data::ReadScene(DeploymentPath("suspension"));
  for (auto& beam : scene.beams) {
    beam.segments = 3;
    beam.axial_elastic = elastic;
    beam.damping = beta;
  }
  return Compile(scene);
}

TEST(Saddle, Deployment) { ExpectSolves(Deployment(false, 0.0), true); }
TEST(Saddle, DampedAndAxiallyElastic) { ExpectSolves(Deployment(true, 1e-4), true); }
TEST(Saddle, ClampedBeam) { ExpectSolves(ModelFrom(BeamScene("clamped", 5)), true); }
TEST(Saddle, FreeBeam) { ExpectSolves(ModelFrom(BeamScene("free", 1)), true); }
TEST(Saddle, Pendulum) { ExpectSolves(ModelFrom(PendulumScene(0.3)), true); }

// A loop through the ground, with a beam in it, is no tree.
TEST(Saddle, FourBarWithABeam) {
  ExpectSolves(ModelFrom("[scene]\nname = \"four-bar\"\nduration = 1.0\n"
                         "[body.crank]\nmass = 1.0\ninertia = 0.1\n"
                         "[body.rocker]\nmass = 1.0\ninertia = 0.1\n"
                         "[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 10.0\nsegments = 4\n"
                         "[joint.a]\ninner = \"ground\"\nouter = \"crank\"\n"
                         "outer_point = [-0.2, 0.0]\ntheta = 1.2\n"
                         "[joint.b]\ninner = \"crank\"\ninner_point = [0.2, 0.0]\n"
                         "outer = \"rod.start\"\ntheta = -1.1\n"
                         "[joint.c]\ninner = \"rod.end\"\nouter = \"rocker\"\n"
                         "outer_point = [-0.4, 0.0]\ntheta = -1.4\n"
                         "[joint.d]\ninner = \"ground\"\ninner_point = [1.1, 0.0]\n"
                         "outer = \"rocker\"\nouter_point = [0.4, 0.0]\ntheta = -1.3\n"),
               false);
}

}  // namespace
}  // namespace unfurl::sim::kkt_test
