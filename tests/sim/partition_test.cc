#include "sim/constraints/partition.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "base/random.h"
#include "runs.h"
#include "scenes.h"
#include "sim/dynamics/dynamics.h"
#include "sim/methods/simulate.h"

namespace unfurl::sim::partition_test {
namespace {

// `bars` bars of length 1 in a chain from the origin; with `closed`, its end is pinned to the
// ground too, where it comes to lie with the angles given.
std::string ChainScene(int bars, bool closed = false, double theta = 0.3, double ground_x = 0.0,
                       double ground_y = 0.0) {
  std::string text = "[scene]\nname = \"chain\"\nduration = 1.0\n";
  for (int k = 0; k < bars; ++k) {
    text += fmt::format("[body.b{}]\nmass = 1.0\ninertia = 0.0833\n", k);
    text += fmt::format(
        "[joint.j{}]\ninner = \"{}\"\n{}outer = \"b{}\"\nouter_point = [-0.5, 0.0]\ntheta = {}\n",
        k, k == 0 ? "ground" : fmt::format("b{}", k - 1),
        k == 0 ? "" : "inner_point = [0.5, 0.0]\n", k, theta);
  }
  if (closed) {
    text += fmt::format(
        "[joint.last]\ninner = \"ground\"\ninner_point = [{}, {}]\nouter = \"b{}\"\nouter_point = "
        "[0.5, 0.0]\ntheta = {}\n",
        ground_x, ground_y, bars - 1, bars * theta);
  }
  return text;
}

void MakeSmooth(int order, data::Scene* scene) {
  for (auto& beam : scene->beams) {
    beam.model = data::BeamModel::kKirchhoff;
    beam.order = order;
  }
}

std::vector<double> JacobianOf(const Model& model, JacobianEntries* entries) {
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state;
  dynamics.EvaluateConstraints(0.0, y.data());
  const double* values = entries->At(dynamics, 0.0, y.data());
  return {values, values + entries->count()};
}

// The columns of the dependent coordinates, dense.
Eigen::MatrixXd Dependent(const JacobianEntries& entries, const Partition& partition,
                          const std::vector<double>& values) {
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(entries.rows(), entries.columns());
  for (int row = 0; row < entries.rows(); ++row) {
    for (int e = entries.first(row); e < entries.first(row + 1); ++e) {
      J(row, entries.column(e)) += values[static_cast<std::size_t>(e)];
    }
  }
  Eigen::MatrixXd Ju(entries.rows(), partition.dependents().size());
  for (std::size_t c = 0; c < partition.dependents().size(); ++c) {
    Ju.col(static_cast<Eigen::Index>(c)) = J.col(partition.dependents()[c]);
  }
  return Ju;
}

TEST(Partition, CorrectSolvesForTheDependentCoordinates) {
  Rng rng(5);
  data::Scene deployment = data::ReadScene(DeploymentPath("clearance"));
  for (auto& beam : deployment.beams) beam.segments = 3;
  data::Scene smooth = data::ReadScene(DeploymentPath("clearance"));
  MakeSmooth(2, &smooth);
  for (const Model& model :
       {ModelFrom(ChainScene(5)), ModelFrom(ChainScene(4, true, 0.5, 2.6, 2.4)),
        Compile(deployment), Compile(smooth)}) {
    JacobianEntries entries(model);
    const std::vector<double> six = JacobianOf(model, &entries);
    Partition partition(entries, 1.0);
    partition.Choose(six.data());
    EXPECT_TRUE(partition.redundant().empty());
    ASSERT_EQ(static_cast<int>(partition.dependents().size()), model.constraints.count());
    for (const bool again : {false, true}) {
      bool turned = true;
      if (again) {
        EXPECT_GT(partition.Factor(six.data(), &turned), 0.2);
        EXPECT_FALSE(turned);
      }
      std::vector<double> b(model.constraints.rows(), 0.0), x(3 * model.rigid_bodies.count, 0.0);
      Eigen::VectorXd right(model.constraints.rows());
      for (int row = 0; row < model.constraints.rows(); ++row) {
        b[row] = model.constraints.IsActive(row) ? rng.Uniform(-1.0, 1.0) : 0.0;
        right[row] = b[row];
      }
      partition.Correct(b.data(), x.data());
      const Eigen::MatrixXd Ju = Dependent(entries, partition, six);
      Eigen::VectorXd u(Ju.cols());
      for (Eigen::Index c = 0; c < u.size(); ++c) u[c] = -x[partition.dependents()[c]];
      EXPECT_LT((Ju * u - right).norm(), 1e-11 * (1.0 + u.norm()));
    }
  }
}

TEST(Partition, AChainHasNoFill) {
  const Model model = ModelFrom(ChainScene(60));
  JacobianEntries entries(model);
  Partition partition(entries, 1.0);
  partition.Choose(JacobianOf(model, &entries).data());
  EXPECT_EQ(partition.fill(), 0);
}

TEST(Partition, ARingHasBoundedFill) {
  const int bars = 60;
  const double turn = 2.0 * M_PI / bars;
  // A regular polygon comes back to where it began.
  const Model model = ModelFrom(ChainScene(bars, true, turn));
  JacobianEntries entries(model);
  Partition partition(entries, 1.0);
  partition.Choose(JacobianOf(model, &entries).data());
  EXPECT_TRUE(partition.redundant().empty());
  EXPECT_LT(partition.fill(), 12 * bars);
}

// Bars of lengths a (crank), b, c (rocker) over a ground of length d.
data::Scene FourBar(double a, double b, double c, double d, double crank_rate) {
  const std::string text = fmt::format(
      "[scene]\nname = \"four bar\"\nduration = 2.0\n"
      "[body.crank]\nmass = 1.0\ninertia = 0.02\n[body.rod]\nmass = 1.0\ninertia = 0.3\n"
      "[body.rocker]\nmass = 1.0\ninertia = 0.2\n"
      "[joint.a]\ninner = \"ground\"\nouter = \"crank\"\nouter_point = [{0}, 0.0]\ntheta = 1.0\n"
      "theta_rate = {4}\n"
      "[joint.b]\ninner = \"crank\"\ninner_point = [{1}, 0.0]\nouter = \"rod\"\n"
      "outer_point = [{5}, 0.0]\ntheta = -0.7\n"
      "[joint.c]\ninner = \"rod\"\ninner_point = [{2}, 0.0]\nouter = \"rocker\"\n"
      "outer_point = [{3}, 0.0]\ntheta = 1.2\n"
      "[joint.d]\ninner = \"ground\"\ninner_point = [{7}, 0.0]\nouter = \"rocker\"\n"
      "outer_point = [{6}, 0.0]\ntheta = 1.5\n"
      "[gravity]\nacceleration = [0.0, -9.81]\n"
      "[mark.end]\non = \"rocker\"\npoint = [{3}, 0.0]\n",
      -a / 2, a / 2, b / 2, c / 2, crank_rate, -b / 2, -c / 2, d);
  return data::ParseScene(text, "test.toml");
}
// The crank turns round (Grashof), so that its angle would do for ever.
data::Scene CrankRocker() { return FourBar(0.4, 1.2, 1.0, 1.2, 12.0); }
// No bar turns round: each comes to dead centres, where its angle will not do.
data::Scene TripleRocker() { return FourBar(0.8, 0.7, 0.8, 1.5, 6.0); }

TEST(Partitioned, AgreesWithProjection) {
  data::Scene deployment = data::ReadScene(DeploymentPath("suspension"));
  for (auto& beam : deployment.beams) beam.segments = 3;
  deployment.duration = 0.5;
  data::Scene chain = data::ParseScene(
      ChainScene(4) + "[gravity]\nacceleration = [0.0, -9.81]\n[mark.tip]\non = \"b3\"\n", "t");
  data::Scene smooth = deployment, stretching = deployment;
  MakeSmooth(2, &smooth);
  MakeSmooth(1, &stretching);
  for (auto& beam : stretching.beams) {
    beam.axial_elastic = true;
    beam.EA = 1e4;
  }
  stretching.name = "stretching";
  for (const data::Scene& scene :
       {deployment, smooth, stretching, chain, CrankRocker(), TripleRocker()}) {
    const Model model = Compile(scene);
    SimulateOptions options;
    options.rtol = 1e-9;
    options.method = Method::kProjected;
    const MarkTracks projected = SimulateMarks(model, options);
    options.method = Method::kPartitioned;
    const MarkTracks partitioned = SimulateMarks(model, options);
    ASSERT_TRUE(partitioned.report.Usable()) << scene.name << partitioned.report.message;
    ASSERT_EQ(partitioned.t.size(), projected.t.size());
    // Both are off by some ten times the tolerance, of marks that move a metre.
    EXPECT_LT(FarthestApart(projected, partitioned), 2e-7) << scene.name;
    EXPECT_EQ(partitioned.report.projections, 0);
    EXPECT_LT(partitioned.report.largest_position_drift, 1e-10);
  }
}

TEST(Partitioned, ChoosesAnewAsTheMechanismTurns) {
  SimulateOptions options;
  options.method = Method::kPartitioned;
  const SimulateReport report = Simulate(Compile(TripleRocker()), options, nullptr);
  ASSERT_TRUE(report.Usable()) << report.message;
  EXPECT_GT(report.repartitions, 0);
  EXPECT_LT(report.repartitions, report.steps / 4);
}

TEST(Partitioned, ErrorFollowsTheTolerance) {
  const Model model = Compile(CrankRocker());
  SimulateOptions options;
  options.max_step = 1.0;  // the tolerance alone decides
  options.time = 1.0;      // [s]: a swing of the crank
  options.rtol = 1e-12;
  const MarkTracks reference = SimulateMarks(model, options);
  options.method = Method::kPartitioned;
  for (const double rtol : {1e-5, 1e-7, 1e-9}) {
    options.rtol = rtol;
    const double error = FarthestApart(SimulateMarks(model, options), reference);
    EXPECT_LT(error, 30 * rtol);
    EXPECT_GT(error, 0.005 * rtol);
  }
}

}  // namespace
}  // namespace unfurl::sim::partition_test
