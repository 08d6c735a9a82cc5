#include "sim/implicit/tangent.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "base/random.h"
#include "effects.h"
#include "scenes.h"
#include "sim/dynamics/dynamics.h"

namespace unfurl::sim::tangent_test {
namespace {

// Five-point differences with steps of 1e-4: the fourth power leaves 1e-11, rounding 1e-12, of the
// largest entry.
constexpr double kStep = 1e-4;
constexpr double kTolerance = 1e-8;

using Matrix = Eigen::MatrixXd;

// Dense K or D in the order x, y, theta of all bodies, three blocks; places that cannot move are
// left out by zeros.
Matrix Dense(const Model& model, const Tangent& tangent, bool damping) {
  const int n = model.rigid_bodies.count;
  Matrix out = Matrix::Zero(3 * n, 3 * n);
  const auto add = [&](int a, int b, const Tangent::Block& block) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        out(r * n + a, c * n + b) += block[3 * r + c];
        if (a != b) out(c * n + b, r * n + a) += block[3 * r + c];
      }
    }
  };
  for (int s = 0; s < n; ++s) {
    if (model.rigid_bodies.IsDynamic(s)) add(s, s, damping ? tangent.D(s) : tangent.K(s));
  }
  for (std::size_t p = 0; p < tangent.pairs().size(); ++p) {
    const Tangent::Pair& pair = tangent.pairs()[p];
    if (pair.a >= 0) add(pair.a, pair.b, damping ? tangent.PairD(p) : tangent.PairK(p));
  }
  return out;
}

// Q + J^T lambda with the multipliers held, from accelerations times mass and an independent J:
// M a - J^T(lambda_now) + J^T(lambda_held).
class Loads {
 public:
  explicit Loads(const Model& model) : model_(model), dynamics_(model) {}
  Dynamics& dynamics() { return dynamics_; }

  Eigen::VectorXd At(std::vector<double> y, const Eigen::VectorXd* lambda) {
    const int n = model_.rigid_bodies.count;
    std::vector<double> rate(y.size());
    dynamics_.RightSide(0.0, y.data(), rate.data());
    Eigen::VectorXd out(3 * n);
    for (int s = 0; s < n; ++s) {
      out[s] = model_.rigid_bodies.mass[s] * rate[3 * n + s];
      out[n + s] = model_.rigid_bodies.mass[s] * rate[4 * n + s];
      out[2 * n + s] = model_.rigid_bodies.inertia[s] * rate[5 * n + s];
    }
    const int rows = model_.constraints.rows();
    if (rows == 0) return out;
    Constraints::Work work = dynamics_.constraint_work();
    const Eigen::VectorXd now = Eigen::Map<const Eigen::VectorXd>(work.lambda.data(), rows);
    const std::vector<double> J =
        model_.constraints.DenseJacobian(dynamics_.MotionAt(0.0, y.data()), &work);
    const Eigen::VectorXd difference = *lambda - now;
    for (int r = 0; r < rows; ++r) {
      for (int s = 0; s < n; ++s) {
        if (!model_.rigid_bodies.IsDynamic(s)) continue;
        for (int d = 0; d < 3; ++d) {
          out[d * n + s] += J[static_cast<std::size_t>(r) * 3 * n + 3 * s + d] * difference[r];
        }
      }
    }
    return out;
  }

 private:
  const Model& model_;
  Dynamics dynamics_;
};

struct Shake {
  double place = 0.01, angle = 0.1, speed = 1.0;
};

// K and D against differences of the loads about a random state.
void ExpectTangent(const Model& model, const std::vector<LatchMode>& modes, const Shake& shake) {
  Rng rng(7);
  const int n = model.rigid_bodies.count;
  std::vector<double> y = model.initial_state;
  for (int s = 0; s < n; ++s) {
    if (!model.rigid_bodies.IsDynamic(s)) continue;
    y[s] += shake.place * rng.Normal();
    y[n + s] += shake.place * rng.Normal();
    y[2 * n + s] += shake.angle * rng.Normal();
    for (int d = 3; d < 6; ++d) y[d * n + s] = shake.speed * rng.Normal();
  }
  Loads loads(model);
  loads.dynamics().modes() = modes;
  std::vector<double> rate(y.size());
  loads.dynamics().RightSide(0.0, y.data(), rate.data());
  const Eigen::VectorXd lambda = Eigen::Map<const Eigen::VectorXd>(
      loads.dynamics().constraint_work().lambda.data(), model.constraints.rows());
  Tangent tangent;
  for (int pass = 0; pass < 2; ++pass) {  // the first one also notes the pattern
    loads.dynamics().FillTangent(0.0, y.data(), lambda.data(), &tangent);
  }
  double stiffest = 0.0;
  for (const bool damping : {false, true}) {
    const Matrix ours = Dense(model, tangent, damping);
    Matrix theirs = Matrix::Zero(3 * n, 3 * n);
    for (int s = 0; s < n; ++s) {
      if (!model.rigid_bodies.IsDynamic(s)) continue;
      for (int d = 0; d < 3; ++d) {
        const int column = d * n + s;
        for (const auto& [at, weight] :
             {std::pair{1.0, 8.0}, {-1.0, -8.0}, {2.0, -1.0}, {-2.0, 1.0}}) {
          std::vector<double> moved = y;
          moved[(damping ? 3 * n : 0) + column] += at * kStep;
          theirs.col(column) -= weight / (12.0 * kStep) * loads.At(moved, &lambda);
        }
      }
    }
    // The loads' rounding is that of the stiffness, also where the damping is none.
    const double scale = std::max({1.0, theirs.cwiseAbs().maxCoeff(), stiffest});
    if (!damping) stiffest = scale;
    EXPECT_LT((ours - theirs).cwiseAbs().maxCoeff() / scale, kTolerance)
        << (damping ? "damping" : "stiffness");
  }
}

data::Scene SmallDeployment(const char* variant, int segments) {
  data::Scene scene = data::ReadScene(DeploymentPath(variant));
  for (auto& beam : scene.beams) beam.segments = segments;
  return scene;
}

TEST(Tangent, BendingSpringsPinsAndRigidAxes) {
  const Model model = Compile(SmallDeployment("clearance", 3));
  ExpectTangent(model, model.initial_modes, {});
}

// At rest, where the directions of dampers do not count.
TEST(Tangent, EveryEffectAtOnce) {
  std::string text = EverythingScene();
  // A force that follows its body has no symmetric tangent.
  text.replace(text.find("frame = 'body'"), 14, "frame = 'world'");
  ExpectTangent(ModelFrom(text), {}, {0.01, 0.1, 0.0});
}

// Two points of one beam, each between two segments, with a segment in common.
TEST(Tangent, SpringAlongABeam) {
  const Model model = ModelFrom(BeamScene("clamped", 4) +
                                "[spring.s]\na = 'rod'\na_at = 0.25\nb = 'rod'\nb_at = 0.5\n"
                                "stiffness = 30.0\ndamping = 2.0\nfree_length = 0.3\n");
  ExpectTangent(model, {}, {0.02, 0.1, 0.0});
}

TEST(Tangent, SuspensionAndOneSegment) {
  const Model model = Compile(SmallDeployment("suspension", 1));
  ExpectTangent(model, model.initial_modes, {});
}

TEST(Tangent, AxialElasticity) {
  data::Scene scene = SmallDeployment("clearance", 3);
  for (auto& beam : scene.beams) beam.axial_elastic = true;
  const Model model = Compile(scene);
  ExpectTangent(model, model.initial_modes, {});
}

// The damped forces' own change with the shape is left out of K, so at rest.
TEST(Tangent, MaterialDamping) {
  data::Scene scene = SmallDeployment("clearance", 3);
  for (auto& beam : scene.beams) {
    beam.axial_elastic = true;
    beam.damping = 1e-3;
  }
  const Model model = Compile(scene);
  ExpectTangent(model, model.initial_modes, {0.01, 0.1, 0.0});
}

// Both sides of the transition zone, both stops, and apart.
TEST(Tangent, Contact) {
  const Model model = ModelFrom(LatchingBarScene());
  const data::Scene scene = data::ParseScene(LatchingBarScene(), "bar.toml");
  const data::SceneLatch& law = *scene.joints[0].latch;
  const double epsilon = scene.contacts[0].epsilon;
  const Hinge& hinge = model.latches.hinge(0);
  Dynamics dynamics(model);
  Tangent tangent;
  constexpr double kRate = 0.3;  // [rad/s]
  for (const double depth : {0.4 * epsilon, 3.0 * epsilon, -epsilon}) {
    for (const bool upper : {true, false}) {
      dynamics.modes()[0] = {1, upper, !upper};
      const double sign = upper ? 1.0 : -1.0;
      const double theta = sign * ((upper ? law.theta_a : law.theta_b) + depth / law.lever);
      const auto moment = [&](double dtheta, double drate) {
        const Latches::Contact c = model.latches.At(0, upper, theta + dtheta, sign * kRate + drate);
        return -sign * law.lever * c.force;
      };
      constexpr double kAngle = 1e-8, kSpeed = 1e-4;
      const double k = -(moment(kAngle, 0.0) - moment(-kAngle, 0.0)) / (2.0 * kAngle);
      const double d = -(moment(0.0, kSpeed) - moment(0.0, -kSpeed)) / (2.0 * kSpeed);
      std::vector<double> y = model.initial_state, rate(y.size());
      y[model.index.theta(hinge.outer)] = theta * hinge.sign + hinge.zero;
      y[model.index.omega(hinge.outer)] = sign * kRate * hinge.sign;
      dynamics.RightSide(0.0, y.data(), rate.data());
      const std::vector<double> none(model.constraints.rows(), 0.0);
      dynamics.FillTangent(0.0, y.data(), none.data(), &tangent);
      const double spring = std::get<JointEffect<Spring>>(model.joint_effects).count() > 0
                                ? 0.218
                                : 0.0;  // the scene's
      // Second differences leave (1e-8 / 2.5e-4)^2 of the zone's curvature.
      EXPECT_NEAR(tangent.K(hinge.outer)[8] - spring, k, 1e-6 * std::fabs(k) + 1e-9);
      EXPECT_NEAR(tangent.D(hinge.outer)[8], d, 1e-6 * std::fabs(d) + 1e-9);
      EXPECT_EQ(k == 0.0, depth < 0.0);
    }
  }
}

// Springs between points, dampers, tables, friction and a force at a point; at rest, where what
// depends on the rates has no stiffness.
TEST(Tangent, SpringsBetweenPointsDampersTablesAndForces) {
  ExpectTangent(ModelFrom("[scene]\nname = \"effects\"\nduration = 1.0\n"
                          "[body.arm]\nmass = 1.0\ninertia = 0.1\n"
                          "[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 10.0\nsegments = 4\n"
                          "[joint.pivot]\ninner = \"ground\"\nouter = \"arm\"\n"
                          "outer_point = [-0.3, 0.1]\ntheta = 0.2\n"
                          "[joint.pivot.damper]\ndamping = 0.4\n"
                          "[joint.pivot.table]\ntheta = [-1.0, 0.0, 1.0]\n"
                          "moment = [2.0, -1.0, -1.5]\n"
                          "[joint.pivot.friction]\nmoment = 0.3\ncreep_rate = 0.5\n"
                          "[weld.root]\ninner = \"arm\"\ninner_point = [0.2, 0.0]\n"
                          "outer = \"rod.start\"\n"
                          "[spring.stay]\na = \"ground\"\na_point = [0.4, 1.1]\n"
                          "b = \"rod.end\"\nstiffness = 7.0\nfree_length = 0.5\n"
                          "damping = 0.6\n"
                          "[spring.tie]\na = \"arm\"\na_point = [0.1, 0.3]\nb = \"rod.end\"\n"
                          "stiffness = 4.0\nfree_length = 1.5\n"
                          "[force.push]\non = \"arm\"\npoint = [0.1, 0.2]\nforce = [0.7, 0.5]\n"),
                {}, {0.01, 0.1, 0.0});
}

// A slot and a spring along it, whose directions turn.
TEST(Tangent, PinInASlotWithASpring) {
  ExpectTangent(ModelFrom("[scene]\nname = \"body\"\nduration = 1.0\n"
                          "[body.arm]\nmass = 1.0\ninertia = 0.1\n"
                          "[body.block]\nmass = 0.5\ninertia = 0.2\n"
                          "[joint.pivot]\ninner = \"ground\"\nouter = \"arm\"\n"
                          "outer_point = [-0.3, 0.1]\n"
                          "[joint.slot]\ntype = \"pin_in_slot\"\ninner = \"arm\"\n"
                          "inner_point = [0.2, 0.1]\naxis = 0.4\nouter = \"block\"\n"
                          "outer_point = [0.1, -0.2]\ntravel = 0.3\n"
                          "[joint.slot.spring]\nstiffness = 5.0\npreload = 0.7\n"),
                {}, {});
}

TEST(Tangent, BeamFromTheGround) { ExpectTangent(ModelFrom(BeamScene("clamped", 4)), {}, {}); }

}  // namespace
}  // namespace unfurl::sim::tangent_test
