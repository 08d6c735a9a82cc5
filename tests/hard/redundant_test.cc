// A parallelogram with a third, parallel rocker: one constraint follows from the others in every
// state, and which two rockers carry the load is not determined. Success: the scene compiles with a
// warning that names a joint of the loop, moves as the parallelogram without the third rocker does
// when that one's inertia is given to the others, and keeps the constraint that was left out.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "data/scene.h"
#include "sim/methods/simulate.h"
#include "sim/model/model.h"
#include "tests/hard/run_of.h"

namespace unfurl::sim::redundant_test {
namespace {

// Rockers of length 1 on the ground at the places `at`, a coupler over all of them.
std::string Rockers(const std::vector<double>& at, double inertia, double theta,
                    double mass = 1e-6) {
  std::string text =
      "[scene]\nname = \"rockers\"\nduration = 2.0\n[body.coupler]\nmass = 2.0\ninertia = 0.5\n";
  for (std::size_t k = 0; k < at.size(); ++k) {
    text += fmt::format(
        "[body.r{0}]\nmass = {5}\ninertia = {1}\n"
        "[joint.g{0}]\ninner = \"ground\"\ninner_point = [{2}, 0.0]\nouter = \"r{0}\"\n"
        "theta = {3}\n"
        "[joint.c{0}]\ninner = \"r{0}\"\ninner_point = [1.0, 0.0]\nouter = \"coupler\"\n"
        "outer_point = [{2}, 0.0]\ntheta = {4}\n",
        k, inertia, at[k], theta, -theta, mass);
  }
  return text + "[gravity]\nacceleration = [0.0, -9.81]\n[mark.m]\non = \"coupler\"\n";
}

// A smooth boom on the coupler.
constexpr char kBoom[] =
    "[beam.boom]\nlength = 0.8\nmass = 0.3\nEI = 20.0\nmodel = \"kirchhoff\"\norder = 2\n"
    "[weld.w]\ninner = \"coupler\"\ninner_point = [0.5, 0.0]\nouter = \"boom.start\"\n";

TEST(Redundant, AThirdParallelRockerIsSurvived) {
  const double theta = 1.0;
  const Model three =
      Compile(data::ParseScene(Rockers({0.0, 1.0, 2.5}, 0.02, theta), "three.toml"));
  const Model two = Compile(data::ParseScene(Rockers({0.0, 1.0}, 0.03, theta), "two.toml"));
  ASSERT_EQ(three.warnings.size(), 1u);
  EXPECT_TRUE(two.warnings.empty());
  EXPECT_EQ(three.constraints.count(), 11);
  for (const Method method : {Method::kProjected, Method::kPartitioned}) {
    SimulateOptions options;
    options.method = method;
    options.rtol = 1e-8;
    options.duration = 0.6;  // before the rockers lie flat
    const MarkTracks a = SimulateMarks(three, options), b = SimulateMarks(two, options);
    ASSERT_TRUE(a.report.Usable()) << a.report.message;
    EXPECT_LT(Apart(a, b), 100 * options.rtol) << MethodName(method);
    EXPECT_GT(std::hypot(a.x[0].back() - a.x[0][0], a.y[0].back() - a.y[0][0]), 0.3);
  }
}

// The same with a smooth boom on the coupler.
TEST(Redundant, SmoothBeamsMayBeAmongThem) {
  const Model three =
      Compile(data::ParseScene(Rockers({0.0, 1.0, 2.5}, 0.02, 1.0, 2e-6) + kBoom, "three.toml"));
  const Model two =
      Compile(data::ParseScene(Rockers({0.0, 1.0}, 0.03, 1.0, 3e-6) + kBoom, "two.toml"));
  ASSERT_EQ(three.warnings.size(), 1u);
  EXPECT_EQ(three.constraints.count(), two.constraints.count() + 3);
  for (const Method method : {Method::kProjected, Method::kPartitioned}) {
    SimulateOptions options;
    options.method = method;
    options.rtol = 1e-8;
    options.duration = 0.5;  // before the rockers lie flat
    const MarkTracks a = SimulateMarks(three, options), b = SimulateMarks(two, options);
    ASSERT_TRUE(a.report.Usable() && b.report.Usable()) << a.report.message;
    EXPECT_LT(Apart(a, b), 100 * options.rtol) << MethodName(method);
  }
}

// The rockers fall through the flat state, in which the constraints depend on one another, with a
// smooth boom aboard; its energy says whether the way on was taken.
TEST(Redundant, AFlatStateIsPassedWithASmoothBoomAboard) {
  const Model model =
      Compile(data::ParseScene(Rockers({0.0, 1.0}, 0.03, 1.0) + kBoom, "boom.toml"));
  for (const Method method : {Method::kAuto, Method::kProjected, Method::kPartitioned}) {
    SimulateOptions options;
    options.method = method;
    options.duration = 1.2;
    const SimulateReport report = Simulate(model, options, nullptr);
    EXPECT_TRUE(report.Usable()) << MethodName(method) << ": " << report.message;
    EXPECT_LT(report.energy_residual, 1e-3 * report.energy_moved) << MethodName(method);
  }
}

// Straight, of fixed length, and pinned at both ends: its tension is not determined.
TEST(Redundant, AStraightBeamBetweenPinsIsToldToStretch) {
  for (const char* model : {"model = \"kirchhoff\"\n", "segments = 4\n"}) {
    for (const bool elastic : {false, true}) {
      const std::string text = fmt::format(
          "[scene]\nname = \"held\"\nduration = 1.0\n"
          "[beam.b]\nlength = 1.0\nmass = 0.5\nEI = 10.0\n{}{}"
          "[joint.a]\ninner = \"ground\"\nouter = \"b.start\"\ntheta = 0.0\n"
          "[joint.c]\ninner = \"ground\"\ninner_point = [1.0, 0.0]\n"
          "outer = \"b.end\"\ntheta = 0.0\n",
          model, elastic ? "axial = \"elastic\"\nEA = 1e5\n" : "");
      try {
        Compile(data::ParseScene(text, "held.toml"));
        EXPECT_TRUE(elastic) << "not refused";
      } catch (const Error& error) {
        EXPECT_FALSE(elastic) << error.what();
        EXPECT_NE(error.remedy().find("axial = \"elastic\""), std::string::npos) << error.what();
      }
    }
  }
}

TEST(Redundant, AFlatStartIsSaidByTheNamesOfItsJoints) {
  try {
    Compile(data::ParseScene(Rockers({0.0, 1.0}, 0.03, 0.0), "flat.toml"));
    FAIL() << "not refused";
  } catch (const Error& error) {
    const std::string what = error.what();
    EXPECT_NE(what.find("depend on one another at the start"), std::string::npos) << what;
    EXPECT_NE(what.find("'"), std::string::npos) << what;
  }
}

}  // namespace
}  // namespace unfurl::sim::redundant_test
