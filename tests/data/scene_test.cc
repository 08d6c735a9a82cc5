// Every key of a scene, into its record.
#include "data/scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "errors.h"
#include "scene_texts.h"

namespace unfurl::data::scene_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Scene, JointsOfEveryKind) {
  const Scene s = ParseScene(
      std::string(kHead) +
          "[joint.a]\ninner = 'ground'\nouter = 'bar'\ntheta = 0.5\ntheta_rate = 2.0\n"
          "[joint.b]\ntype = 'slider'\ninner = 'bar'\nouter = 'block'\naxis = 0.3\ntravel = 0.1\n"
          "travel_rate = -0.2\nhang_travel = 0.4\nsign = -1\nzero_angle = 0.7\n"
          "[joint.c]\ntype = 'pin_in_slot'\ninner = 'ground'\nouter = 'block'\ntheta = 0.1\n"
          "travel = 0.2\nhang_theta = 0.3\n",
      "s.toml");
  ASSERT_EQ(s.joints.size(), 3u);
  EXPECT_EQ(s.joints[0].kind, SceneJoint::Kind::kRevolute);
  EXPECT_EQ(s.joints[0].theta_rate, 2.0);
  const SceneJoint& b = s.joints[1];
  EXPECT_EQ(b.kind, SceneJoint::Kind::kSlider);
  EXPECT_EQ(b.inner.index, 0);
  EXPECT_EQ(b.outer.index, 1);
  EXPECT_EQ(b.axis, 0.3);
  EXPECT_EQ(b.travel, 0.1);
  EXPECT_EQ(b.travel_rate, -0.2);
  EXPECT_EQ(b.hang_travel, 0.4);
  EXPECT_EQ(b.sign, -1.0);
  EXPECT_EQ(b.zero_angle, 0.7);
  EXPECT_EQ(s.joints[2].kind, SceneJoint::Kind::kPinInSlot);
  EXPECT_EQ(s.joints[2].theta, 0.1);
  EXPECT_EQ(s.joints[2].travel, 0.2);
}

TEST(Scene, WhatActsOnAJoint) {
  const Scene s = ParseScene(std::string(kHead) + kPivot +
                                 "[joint.pivot.spring]\nstiffness = 2.0\nfree = 0.3\n"
                                 "[joint.pivot.damper]\ndamping = 0.5\n"
                                 "[joint.pivot.table]\ntheta = [0, 1, 2]\nmoment = [0.0, 3.0, 1]\n"
                                 "[joint.pivot.friction]\nmoment = 0.1\ncreep_rate = 0.01\n"
                                 "[joint.pivot.motor]\nmoment = '2 * t'\n",
                             "s.toml");
  const SceneJoint& j = s.joints.at(0);
  EXPECT_EQ(j.spring->preload, -0.3);
  EXPECT_EQ(j.damper->damping, 0.5);
  EXPECT_THAT(j.table->coordinate, ElementsAre(0.0, 1.0, 2.0));
  EXPECT_THAT(j.table->moment, ElementsAre(0.0, 3.0, 1.0));
  EXPECT_EQ(j.friction->moment, 0.1);
  EXPECT_EQ(j.friction->creep_rate, 0.01);
  EXPECT_EQ(j.motor->moment.Value(0.5), 1.0);
}

TEST(Scene, EffectsOnATravelAreForces) {
  const Scene s = ParseScene(
      std::string(kHead) +
          "[joint.s]\ntype = 'slider'\ninner = 'ground'\nouter = 'bar'\n"
          "[joint.s.table]\ntravel = [0, 1]\nforce = [5, 6]\n"
          "[joint.s.friction]\nforce = 4\ncreep_rate = 0.01\n"
          "[joint.s.motor]\nforce = {t = [0, 2], value = [0, 8], interpolation = 'linear'}\n",
      "s.toml");
  EXPECT_THAT(s.joints[0].table->moment, ElementsAre(5.0, 6.0));
  EXPECT_EQ(s.joints[0].friction->moment, 4.0);
  EXPECT_EQ(s.joints[0].motor->moment.Value(1.0), 4.0);
}

TEST(Scene, DrivesSayWhereTheirJointStarts) {
  const Scene by_position = ParseScene(
      std::string(kHead) + kPivot + "[joint.pivot.drive]\nposition = '0.2 + 3 * t'\n", "s.toml");
  EXPECT_FALSE(by_position.joints[0].drive->by_rate);
  EXPECT_EQ(by_position.joints[0].theta, 0.2);
  EXPECT_EQ(by_position.joints[0].theta_rate, 3.0);
  const Scene by_rate = ParseScene(
      std::string(kHead) + kPivot + "theta = 0.4\n[joint.pivot.drive]\nrate = 150\n", "s.toml");
  EXPECT_TRUE(by_rate.joints[0].drive->by_rate);
  EXPECT_EQ(by_rate.joints[0].theta, 0.4);
  EXPECT_EQ(by_rate.joints[0].theta_rate, 150.0);
}

TEST(Scene, SpringsForcesEventsMarks) {
  const Scene s = ParseScene(
      std::string(kHead) + kRod + kPivot +
          "[spring.s]\na = 'bar'\na_point = [0.1, 0.2]\nb = 'rod'\nb_at = 0.25\nstiffness = 7\n"
          "damping = 0.5\nfree_length = 0.3\n"
          "[spring.u]\na = 'ground'\nb = 'rod.end'\ndamping = 2\n"
          "[force.f]\non = 'bar'\npoint = [0.5, 0]\nforce = [1, 'sin(t)']\nframe = 'body'\n"
          "[force.m]\non = 'rod.end'\ntorque = {t = [0, 1], value = [2, 3]}\n"
          "[force.q]\non = 'rod'\nper_length = [0, -9.81]\n"
          "[event.e]\nwhen = 'pivot.theta'\nlevel = 0.1\ndirection = 'falling'\nstop = true\n"
          "[mark.m]\non = 'rod'\nat = 0.5\n",
      "s.toml");
  EXPECT_EQ(s.linear_springs[0].a.point[1], 0.2);
  EXPECT_EQ(s.linear_springs[0].b.kind, SceneEnd::Kind::kAlongBeam);
  EXPECT_EQ(s.linear_springs[0].b.at, 0.25);
  EXPECT_EQ(s.linear_springs[0].free_length, 0.3);
  EXPECT_FALSE(s.linear_springs[1].free_length);
  EXPECT_EQ(s.linear_springs[1].damping, 2.0);
  EXPECT_EQ(s.forces[0].kind, SceneForce::Kind::kForce);
  EXPECT_TRUE(s.forces[0].follows);
  EXPECT_EQ(s.forces[0].force[0].Value(3.0), 1.0);
  EXPECT_EQ(s.forces[0].force[1].Value(3.0), std::sin(3.0));
  EXPECT_EQ(s.forces[1].kind, SceneForce::Kind::kTorque);
  EXPECT_EQ(s.forces[1].on.kind, SceneEnd::Kind::kBeamEnd);
  EXPECT_NEAR(s.forces[1].torque.Value(0.5), 2.5, 1e-15);
  EXPECT_EQ(s.forces[2].kind, SceneForce::Kind::kPerLength);
  EXPECT_EQ(s.forces[2].on.index, 0);
  EXPECT_FALSE(s.forces[2].follows);
  EXPECT_EQ(s.watches[0].quantity, "pivot.theta");
  EXPECT_EQ(s.watches[0].direction, SceneWatch::Direction::kFalling);
  EXPECT_TRUE(s.watches[0].stop);
  EXPECT_EQ(s.marks[0].on.at, 0.5);
}

TEST(Scene, BeamModelsAndSolver) {
  const Scene s = ParseScene(std::string(kHead) + kRod +
                                 "model = 'kirchhoff'\norder = 7\n"
                                 "[solver]\nmethod = 'implicit'\nrtol = 1e-4\nrate = 500\n",
                             "s.toml");
  EXPECT_EQ(s.beams[0].model, BeamModel::kKirchhoff);
  EXPECT_EQ(s.beams[0].order, 7);
  EXPECT_EQ(s.solver.method, "implicit");
  EXPECT_EQ(s.solver.rtol, 1e-4);
  EXPECT_EQ(s.solver.rate, 500.0);
  EXPECT_FALSE(ParseScene(kHead, "s.toml").solver.rtol);
}

// Every kind of value from the command line, and each with the same checks.
TEST(Scene, OverridesReachEveryKey) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("unfurl_scene_" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  const std::string path = (folder / "s.toml").string();
  std::ofstream(path) << kHead << kRod << kPivot << "[force.f]\non = 'bar'\nforce = [0, 0]\n";
  const auto read = [&](const std::vector<std::string>& sets) { return ReadScene(path, sets); };
  const Scene s =
      read({"joint.pivot.motor.moment=sin(t)", "beam.rod.model=kirchhoff", "solver.rtol=1e-3",
            "force.f.force=[1, \"2 * t\"]", "joint.pivot.table={theta = [0, 1], moment = [2, 3]}",
            "event.e.when=pivot.theta", "event.e.stop=true", "body.bar.pose=[1, 2, 3]"});
  EXPECT_EQ(s.joints[0].motor->moment.Value(1.0), std::sin(1.0));
  EXPECT_EQ(s.beams[0].model, BeamModel::kKirchhoff);
  EXPECT_EQ(s.solver.rtol, 1e-3);
  EXPECT_EQ(s.forces[0].force[1].Value(2.0), 4.0);
  EXPECT_EQ(s.joints[0].table->moment[1], 3.0);
  EXPECT_TRUE(s.watches[0].stop);
  EXPECT_EQ((*s.bodies[0].pose)[2], 3.0);
  EXPECT_THAT(ErrorOf([&] { read({"force.f.force=[1, \"2 * u\"]"}); }),
              HasSubstr("--set force.f.force: column 5"));
  EXPECT_THAT(ErrorOf([&] { read({"joint.pivot.motor.moment=sim(t)"}); }),
              HasSubstr("--set joint.pivot.motor.moment: column 1"));
  EXPECT_THAT(ErrorOf([&] { read({"joint.pivot.moter.moment=1"}); }),
              HasSubstr("joint.pivot.moter: unknown key; did you mean 'motor'?"));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace unfurl::data::scene_test
