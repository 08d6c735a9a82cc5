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

namespace unfurl::sim::redundant_test {
namespace {

// Rockers of length 1 on the ground at the places `at`, a coupler over all of them.
std::string Rockers(const std::vector<double>& at, double inertia, double theta) {
  std::string text =
      "[scene]\nname = \"rockers\"\nduration = 2.0\n[body.coupler]\nmass = 2.0\ninertia = 0.5\n";
  for (std::size_t k = 0; k < at.size(); ++k) {
    text += fmt::format(
        "[body.r{0}]\nmass = 1e-6\ninertia = {1}\n"
        "[joint.g{0}]\ninner = \"ground\"\ninner_point = [{2}, 0.0]\nouter = \"r{0}\"\n"
        "theta = {3}\n"
        "[joint.c{0}]\ninner = \"r{0}\"\ninner_point = [1.0, 0.0]\nouter = \"coupler\"\n"
        "outer_point = [{2}, 0.0]\ntheta = {4}\n",
        k, inertia, at[k], theta, -theta);
  }
  return text + "[gravity]\nacceleration = [0.0, -9.81]\n[mark.m]\non = \"coupler\"\n";
}

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
    double worst = 0.0;
    for (std::size_t k = 0; k < a.t.size(); ++k) {
      worst = std::max(worst, std::hypot(a.x[0][k] - b.x[0][k], a.y[0][k] - b.y[0][k]));
    }
    EXPECT_LT(worst, 100 * options.rtol) << MethodName(method);
    EXPECT_GT(std::hypot(a.x[0].back() - a.x[0][0], a.y[0].back() - a.y[0][0]), 0.3);
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
