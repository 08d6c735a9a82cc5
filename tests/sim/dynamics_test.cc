#include "sim/dynamics/dynamics.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>

#include "base/random.h"
#include "dense_formulation.h"
#include "scenes.h"

namespace unfurl::sim::dynamics_test {
namespace {

// Five-point derivatives with steps of 1e-3 and rounding: a few 1e-11 of the largest acceleration
// are seen; thirty times that.
constexpr double kTolerance = 1e-9;

// The bodies' state, moved at random: angles enough to bend the beams well beyond what the
// deployment does, velocities as large as its own.
std::vector<double> RandomState(const Model& model, Rng* rng) {
  std::vector<double> y = model.initial_state;
  const StateIndex& i = model.index;
  for (int s = 0; s < model.rigid_bodies.count; ++s) {
    if (!model.rigid_bodies.IsDynamic(s)) continue;
    y[i.x(s)] += rng->Normal() * 0.01;
    y[i.y(s)] += rng->Normal() * 0.01;
    y[i.theta(s)] += rng->Normal() * 0.1;
    y[i.vx(s)] = rng->Normal();
    y[i.vy(s)] = rng->Normal();
    y[i.omega(s)] = rng->Normal() * 3.0;
  }
  return y;
}

struct Comparison {
  Eigen::VectorXd model, dense;
};

// Accelerations of every body of the scene from both formulations.
Comparison Compare(const data::Scene& scene, DenseFormulation& dense, const Model& model,
                   std::vector<double> y, const std::vector<LatchMode>& modes) {
  Dynamics dynamics(model);
  dynamics.modes() = modes;
  std::vector<double> rate(y.size());
  dynamics.RightSide(0.0, y.data(), rate.data());
  const StateIndex& i = model.index;
  const Eigen::Index n = 3 * dense.bodies();
  Eigen::VectorXd q(n), v(n), a(n);
  for (int b = 0; b < static_cast<int>(model.bodies.size()); ++b) {
    const Model::Body& body = model.bodies[b];
    const int s = body.centre.body;
    const double t = y[i.theta(s)], w = y[i.omega(s)], al = rate[i.omega(s)];
    const double ox = std::cos(t) * body.centre.px - std::sin(t) * body.centre.py;
    const double oy = std::sin(t) * body.centre.px + std::cos(t) * body.centre.py;
    q.segment<3>(3 * b) << y[i.x(s)] + ox, y[i.y(s)] + oy, t + body.angle;
    v.segment<3>(3 * b) << y[i.vx(s)] - w * oy, y[i.vy(s)] + w * ox, w;
    a.segment<3>(3 * b) << rate[i.vx(s)] - al * oy - w * w * ox,
        rate[i.vy(s)] + al * ox - w * w * oy, al;
  }
  for (std::size_t b = 0; b < scene.beams.size(); ++b) {
    for (int k = 0; k < scene.beams[b].segments; ++k) {
      const int s = model.beams[b].first + k;
      const int at = 3 * dense.SegmentOf(static_cast<int>(b), k);
      q.segment<3>(at) << y[i.x(s)], y[i.y(s)], y[i.theta(s)];
      v.segment<3>(at) << y[i.vx(s)], y[i.vy(s)], y[i.omega(s)];
      a.segment<3>(at) << rate[i.vx(s)], rate[i.vy(s)], rate[i.omega(s)];
    }
  }
  dense.joint_moment.assign(scene.joints.size(), 0.0);
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    if (!scene.joints[j].latch || !modes[model.joints[j].latch].latched) continue;
    // The contact law once more, from the paper.
    const auto& latch = *scene.joints[j].latch;
    const auto& c = scene.contacts[latch.contact];
    const double h = 1e-6;
    const double theta = dense.Theta(q, static_cast<int>(j));
    const double theta_rate = (dense.Theta(q + h * v, static_cast<int>(j)) -
                               dense.Theta(q - h * v, static_cast<int>(j))) /
                              (2 * h);
    for (const double side : {1.0, -1.0}) {
      const double stop = side > 0 ? latch.theta_a : latch.theta_b;
      const double delta = latch.lever * (side * theta - stop);
      if (delta <= 0.0) continue;
      const double T =
          std::exp((delta - c.epsilon - std::fabs(delta - c.epsilon)) * c.Q / c.epsilon);
      const double f = c.K * std::pow(delta, 1.5) + c.C * T * latch.lever * side * theta_rate;
      dense.joint_moment[j] -= side * latch.lever * std::max(f, 0.0);
    }
  }
  return {a, dense.Accelerations(q, v)};
}

data::Scene Deployment(const std::string& variant, int segments, double damping) {
  data::Scene scene = data::ReadScene(DeploymentPath(variant));
  for (auto& beam : scene.beams) {
    beam.segments = segments;
    beam.damping = damping;
  }
  return scene;
}

// Where the deployed bodies are, from the measures of the deployment.
std::vector<std::array<double, 2>> DeployedPlaces(int segments) {
  std::vector<std::array<double, 2>> places = {{0.0, 0.0}};
  for (const double x : {0.17, 0.19, 1.01, 1.03, -0.17, -0.19, -1.01, -1.03}) {
    places.push_back({x, 0.0});
  }
  for (const double start : {0.20, 1.04, -0.20, -1.04}) {
    for (int k = 0; k < segments; ++k) {
      const double along = (k + 0.5) * 0.8 / segments;
      places.push_back({start + (start > 0 ? along : -along), 0.0});
    }
  }
  return places;
}

TEST(Dynamics, DeploymentAgreesWithTheDenseFormulation) {
  Rng rng(11);
  for (const int segments : {1, 3}) {
    const data::Scene scene = Deployment("suspension", segments, 5e-5);
    const Model model = Compile(scene);
    DenseFormulation dense(scene);
    dense.hang = DeployedPlaces(segments);
    for (int trial = 0; trial < 3; ++trial) {
      const Comparison c =
          Compare(scene, dense, model, RandomState(model, &rng), model.initial_modes);
      EXPECT_LT((c.model - c.dense).cwiseAbs().maxCoeff(),
                kTolerance * c.dense.cwiseAbs().maxCoeff());
    }
  }
}

TEST(Dynamics, ContactsAgreeWithTheDenseFormulation) {
  Rng rng(12);
  data::Scene scene = Deployment("clearance", 2, 0.0);
  // Deployed, a little beyond the stops: upper, lower, upper (separating), within.
  const double theta[4] = {0.0058, -0.0056, 0.0054, 0.0};
  for (int j = 0; j < 4; ++j) scene.joints[j].theta = theta[j];
  const Model model = Compile(scene);
  DenseFormulation dense(scene);
  std::vector<LatchMode> modes = model.initial_modes;
  modes[0] = {1, 1, 0};
  modes[1] = {1, 0, 1};
  modes[2] = {1, 1, 0};
  modes[3] = {1, 0, 0};
  for (int trial = 0; trial < 4; ++trial) {
    std::vector<double> y = model.initial_state;
    for (int s = 0; s < model.rigid_bodies.count; ++s) {
      if (!model.rigid_bodies.IsDynamic(s)) continue;
      y[model.index.omega(s)] = 0.3 * rng.Normal();
      y[model.index.vx(s)] = 0.3 * rng.Normal();
    }
    const Comparison c = Compare(scene, dense, model, y, modes);
    EXPECT_LT((c.model - c.dense).cwiseAbs().maxCoeff(),
              kTolerance * c.dense.cwiseAbs().maxCoeff());
  }
}

TEST(Dynamics, ElasticBeamsAndGroundAgreeWithTheDenseFormulation) {
  Rng rng(13);
  const std::string text =
      "[scene]\nname = \"s\"\nduration = 1.0\n"
      "[body.block]\nmass = 0.7\ninertia = 0.02\n"
      "[beam.a]\nlength = 0.6\nmass = 0.4\nEI = 5.0\nEA = 2e3\naxial = \"elastic\"\nsegments = 3\n"
      "damping = 1e-3\n"
      "[beam.b]\nlength = 0.5\nmass = 0.3\nEI = 4.0\nsegments = 2\n"
      "[weld.root]\ninner = \"ground\"\ninner_point = [0.3, -0.2]\nouter = \"a.start\"\nangle = "
      "0.4\n"
      "[weld.middle]\ninner = \"a.end\"\nouter = \"block\"\nouter_point = [-0.05, 0.02]\nangle = "
      "0.3\n"
      "[joint.pin]\ninner = \"block\"\ninner_point = [0.05, 0.0]\nouter = \"b.start\"\ntheta = "
      "0.5\n"
      "[gravity]\nacceleration = [0.3, -9.81]\n";
  const data::Scene scene = data::ParseScene(text, "s.toml");
  const Model model = Compile(scene);
  DenseFormulation dense(scene);
  for (int trial = 0; trial < 3; ++trial) {
    const Comparison c = Compare(scene, dense, model, RandomState(model, &rng), {});
    EXPECT_LT((c.model - c.dense).cwiseAbs().maxCoeff(),
              kTolerance * c.dense.cwiseAbs().maxCoeff());
  }
}

// J M^-1 J^T, factored along the graph, against the dense matrix of the same Jacobian.
TEST(Dynamics, MultipliersAgreeWithTheDenseSchurComplement) {
  Rng rng(14);
  const Model model = Compile(Deployment("suspension", 5, 0.0));
  const int n = model.rigid_bodies.count;
  Dynamics dynamics(model);
  std::vector<double> y = RandomState(model, &rng), rate(y.size());
  dynamics.RightSide(0.0, y.data(), rate.data());
  const Motion motion = dynamics.Update(0.0, y.data());
  Constraints::Work work = model.constraints.MakeWork();
  for (std::size_t k = 0; k < model.rigid_bodies.stations.size(); ++k) {
    const Station& s = model.rigid_bodies.stations[k];
    work.station[2 * k] = motion.x[s.index] - motion.x[s.body];
    work.station[2 * k + 1] = motion.y[s.index] - motion.y[s.body];
  }
  const std::vector<double> flat = model.constraints.DenseJacobian(motion, &work);
  std::vector<Eigen::RowVectorXd> rows;
  for (int r = 0; r < model.constraints.rows(); ++r) {
    const Eigen::Map<const Eigen::RowVectorXd> row(&flat[static_cast<std::size_t>(r) * 3 * n],
                                                   3 * n);
    if (row.squaredNorm() > 0.0) rows.push_back(row);
  }
  ASSERT_EQ(static_cast<int>(rows.size()), model.constraints.count());
  Eigen::MatrixXd J(rows.size(), 3 * n);
  for (std::size_t r = 0; r < rows.size(); ++r) J.row(r) = rows[r];
  Eigen::VectorXd W(3 * n);
  for (int k = 0; k < n; ++k) {
    W.segment<3>(3 * k) << model.rigid_bodies.inverse_mass[k], model.rigid_bodies.inverse_mass[k],
        model.rigid_bodies.inverse_inertia[k];
  }
  // Constraint forces change accelerations only by W J^T lambda: project any load dense and sparse.
  std::vector<double> fx(n), fy(n), m(n);
  Eigen::VectorXd f(3 * n);
  for (int k = 0; k < n; ++k) {
    fx[k] = rng.Normal(), fy[k] = rng.Normal(), m[k] = rng.Normal();
    f.segment<3>(3 * k) << fx[k], fy[k], m[k];
  }
  std::vector<double> still(y);
  for (int k = 3 * n; k < 6 * n; ++k) still[k] = 0.0;  // no velocity, so gamma = 0
  const Motion at_rest = dynamics.Update(0.0, still.data());
  model.constraints.Accelerate(at_rest, {fx.data(), fy.data(), m.data()}, &work);
  const Eigen::VectorXd free = W.asDiagonal() * f;
  const Eigen::MatrixXd S = J * W.asDiagonal() * J.transpose();
  const Eigen::VectorXd expected = free - W.asDiagonal() * J.transpose() * S.ldlt().solve(J * free);
  double worst = 0.0;
  for (int k = 0; k < n; ++k) {
    worst = std::max({worst, std::fabs(work.ax[k] - expected[3 * k]),
                      std::fabs(work.ay[k] - expected[3 * k + 1]),
                      std::fabs(work.alpha[k] - expected[3 * k + 2])});
  }
  constexpr double kRounding = 1e-11;  // relative, of a solve with condition below 1e4
  EXPECT_LT(worst, kRounding * expected.cwiseAbs().maxCoeff());
}

TEST(Dynamics, ProjectionRemovesDriftToSecondOrder) {
  Rng rng(15);
  const Model model = Compile(Deployment("clearance", 4, 0.0));
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state, rate(y.size());
  for (int s = 0; s < model.rigid_bodies.count; ++s) {
    if (!model.rigid_bodies.IsDynamic(s)) continue;
    y[model.index.x(s)] += 1e-5 * rng.Normal();
    y[model.index.theta(s)] += 1e-5 * rng.Normal();
    y[model.index.vy(s)] += 1e-3 * rng.Normal();
  }
  double before = 0.0;
  for (int k = 0; k < 3; ++k) {
    dynamics.RightSide(0.0, y.data(), rate.data());
    if (k == 0) before = dynamics.PositionDrift(0.0, y.data());
    dynamics.Project(0.0, y.data());
  }
  dynamics.RightSide(0.0, y.data(), rate.data());
  EXPECT_GT(before, 1e-6);
  EXPECT_LT(dynamics.PositionDrift(0.0, y.data()), 1e-15);  // rounding of lengths near 1 m
  EXPECT_LT(dynamics.VelocityDrift(0.0, y.data()), 1e-14);
}

}  // namespace
}  // namespace unfurl::sim::dynamics_test
