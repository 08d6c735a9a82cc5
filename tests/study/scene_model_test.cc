// A scene as a model: read once, and any number of it a parameter.
#include "study/scene_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "base/error.h"
#include "data/atomic_file.h"
#include "sim/model/model.h"
#include "tests/own_folder.h"

namespace unfurl::study::scene_model_test {
namespace {

// A free body under gravity: x = vx t, y = vy t + a t^2 / 2, in closed form.
constexpr char kFalling[] = R"(
[scene]
name = "falling"
duration = 1.0
[body.stone]
mass = 2.0
inertia = 0.1
pose = [0.0, 0.0, 0.0]
velocity = [1.0, 0.0, 0.0]
[gravity]
acceleration = [0.0, -9.81]
[mark.m]
on = "stone"
)";

class SceneModelTest : public ::testing::Test {
 protected:
  void SetUp() override { data::WriteTextFile(path_, kFalling); }

  SceneModelOptions Options(const std::vector<std::vector<std::string>>& keys) const {
    SceneModelOptions options;
    options.scene = path_;
    options.keys = keys;
    options.rtol = 1e-9;
    return options;
  }
  static Eigen::Vector3d At(const SceneModel& model, const std::vector<double>& theta, double t) {
    correlate::Stamps stamps;
    stamps.marks = {"m"};
    stamps.t = {{t}};
    const correlate::Prediction p = model.Evaluate(theta, stamps);
    EXPECT_EQ(p.status, correlate::ModelStatus::kGood) << p.message;
    return p.marks[0].p.col(0);
  }
  OwnFolder folder_;
  std::string path_ = folder_.File("scene.toml");
};

TEST_F(SceneModelTest, AnItemOfAnArrayIsAParameter) {
  const SceneModel model(Options({{"gravity.acceleration[1]"}, {"body.stone.velocity[0]"}}),
                         std::vector<double>{-9.81, 1.0});
  constexpr double kT = 0.5;
  for (double g : {-9.81, -1.62, 0.0}) {
    const Eigen::Vector3d p = At(model, {g, 3.0}, kT);
    EXPECT_NEAR(p.x(), 3.0 * kT, 1e-8);
    EXPECT_NEAR(p.y(), 0.5 * g * kT * kT, 1e-8);
  }
}

TEST_F(SceneModelTest, EditingTheSceneChangesNothingOnceItIsRead) {
  const SceneModel model(Options({{"gravity.acceleration[1]"}}), std::vector<double>{-9.81});
  const Eigen::Vector3d before = At(model, {-9.81}, 0.5);
  data::WriteTextFile(path_, "this is = not a [scene");
  EXPECT_EQ(At(model, {-9.81}, 0.5), before);
  std::filesystem::remove(path_);
  EXPECT_EQ(At(model, {-9.81}, 0.5), before);
  data::WriteTextFile(path_, kFalling);
}

// A rotor that a damper brakes: w = w0 e^(-c t / J), and what the damper took is
// J w0^2 (1 - e^(-2 c t / J)) / 2. It was a column of noughts.
TEST_F(SceneModelTest, EnergiesLostAreAddedUpWhereTheyAreAskedFor) {
  constexpr double kInertia = 0.5, kRate = 3.0, kDamping = 0.2;
  data::WriteTextFile(path_,
                      "[scene]\nname = \"rotor\"\nduration = 1.0\n"
                      "[body.rotor]\nmass = 1.0\ninertia = 0.5\n"
                      "[joint.hinge]\ninner = \"ground\"\nouter = \"rotor\"\ntheta_rate = 3.0\n"
                      "[joint.hinge.damper]\ndamping = 0.1\n");
  const std::vector<double> theta = {kDamping};
  const SceneModel model(Options({{"joint.hinge.damper.damping"}}), theta);
  correlate::Stamps stamps;
  const std::vector<double> t = {0.1, 0.4, 0.9};
  for (const char* name : {"energy.dissipated_dampers", "energy.residual", "hinge.theta_rate"}) {
    correlate::QuantityStamps& asked = stamps.quantities.emplace_back();
    asked.key = asked.quantity = name;
    asked.t = t;
  }
  const correlate::Prediction p = model.Evaluate(theta, stamps);
  ASSERT_EQ(p.status, correlate::ModelStatus::kGood) << p.message;
  constexpr double kEnergy = 0.5 * kInertia * kRate * kRate;
  for (std::size_t i = 0; i < t.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const double left = std::exp(-kDamping * t[i] / kInertia);
    EXPECT_NEAR(p.quantities[0].values(k), kEnergy * (1.0 - left * left), 1e-6) << t[i];
    EXPECT_NEAR(p.quantities[1].values(k), 0.0, 1e-6) << t[i];
    EXPECT_NEAR(p.quantities[2].values(k), kRate * left, 1e-6) << t[i];
  }
}

// A motion that is kept, asked at stamps that a clock has moved, is the one that a model of its own
// computes, to the last bit.
TEST_F(SceneModelTest, MovedStampsAreAnsweredByTheSameMotion) {
  const SceneModelOptions options = Options({{"gravity.acceleration[1]"}});
  const std::vector<double> theta = {-9.81};
  const SceneModel keeps(options, theta);
  At(keeps, theta, 0.7);
  for (const double t : {0.6993, 0.7004, 0.2}) {
    EXPECT_EQ(At(keeps, theta, t), At(SceneModel(options, theta), theta, t)) << t;
    EXPECT_NEAR(At(keeps, theta, t).y(), -0.5 * 9.81 * t * t, 1e-8);
  }
}

correlate::Stamps Until(double last) {
  correlate::Stamps stamps;
  stamps.marks = {"m"};
  stamps.t = {{0.0, last}};
  return stamps;
}

TEST(MotionRequest, ReachesPastTheLastStampByAHundredthAtMost) {
  const std::vector<double> theta = {1.0};
  for (double last = 1e-3; last < 1e4; last *= 1.37) {
    const MotionRequest wanted = MotionRequest::For(theta, Until(last));
    EXPECT_GE(wanted.duration, last);
    EXPECT_LE(wanted.duration, std::exp2(1.0 / 64.0) * last * (1.0 + 1e-12));
  }
  // Another point, other marks and a longer record are other motions.
  const MotionRequest one = MotionRequest::For(theta, Until(3.0));
  EXPECT_EQ(one, MotionRequest::For(theta, Until(3.0 - 1e-4)));
  EXPECT_NE(one, MotionRequest::For(theta, Until(3.1)));
  EXPECT_NE(one, MotionRequest::For(std::vector<double>{1.0 + 1e-15}, Until(3.0)));
}

TEST_F(SceneModelTest, AStoreMakesEachMotionOnceAndForgetsTheOldest) {
  const sim::Model model = sim::Compile(data::ReadScene(path_));
  auto wanted = [](double theta, double duration) {
    return MotionRequest::For(std::vector<double>{theta}, Until(duration));
  };
  constexpr double kLong = 3.0;  // [s]
  const std::size_t bytes = SceneMotion(model, wanted(0.0, kLong), 1e-6).bytes();
  MotionStore store(3 * bytes + bytes / 2);
  int made = 0;
  auto get = [&](double theta, double duration) {
    return store.Get(wanted(theta, duration), [&] {
      ++made;
      return std::make_shared<const SceneMotion>(model, wanted(theta, duration), 1e-6);
    });
  };
  const auto first = get(0.0, 1.0);
  EXPECT_EQ(get(0.0, 1.0), first);
  EXPECT_EQ(made, 1);
  for (int k = 1; k <= 4; ++k) get(k, kLong);  // of which three are kept
  EXPECT_EQ(made, 5);
  get(4.0, kLong);
  EXPECT_EQ(made, 5);
  get(0.0, 1.0);
  EXPECT_EQ(made, 6);
}

TEST_F(SceneModelTest, WhatIsWrongIsPlacedAtTheLineOrTheKey) {
  auto where = [&](const SceneModelOptions& options) {
    try {
      SceneModel(options, std::vector<double>{1.0});
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("no error");
  };
  EXPECT_THAT(where(Options({{"gravity.acceleration[7]"}})),
              ::testing::StartsWith("--set gravity.acceleration[7]: "));
  SceneModelOptions negative = Options({{"body.stone.inertia"}});
  negative.set = {"body.stone.mass=-1"};
  EXPECT_THAT(where(negative), ::testing::StartsWith("--set body.stone.mass: "));
  data::WriteTextFile(path_, std::string(kFalling) + "[body.stone2]\nmass = \"heavy\"\n");
  EXPECT_THAT(where(Options({{"body.stone.inertia"}})), ::testing::HasSubstr("toml:15"));
}

}  // namespace
}  // namespace unfurl::study::scene_model_test
