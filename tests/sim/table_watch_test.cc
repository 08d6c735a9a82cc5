#include "sim/methods/table_watch.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scenes.h"
#include "sim/methods/simulate.h"

namespace unfurl::sim::table_watch_test {
namespace {

// A wheel turns through a snap of a table that is as wide as `width`, wherever it lies: work A is
// taken from I w^2 / 2. Steps of 0.02 s see 0.2 rad each.
TEST(TableWatch, SnapsAreNotSteppedOver) {
  constexpr double kInertia = 0.35, kRate = 10.0, kWork = 0.3;
  const double left = std::sqrt(kRate * kRate - 2.0 * kWork / kInertia);
  for (const double width : {0.2, 0.05, 0.01, 1e-3}) {
    for (const double at : {3.0, 4.321}) {
      // Two halves of a smooth cubic: their area is half of the peak times the width, each.
      const std::string scene = fmt::format(
          "[scene]\nname = \"snap\"\nduration = 10.0\n[body.wheel]\nmass = 1.0\ninertia = {}\n"
          "[joint.axle]\ninner = \"ground\"\nouter = \"wheel\"\ntheta_rate = {}\n"
          "[joint.axle.table]\ntheta = [0.0, {:.17g}, {:.17g}, {:.17g}, 300.0]\n"
          "moment = [0.0, 0.0, {:.17g}, 0.0, 0.0]\n[mark.rim]\non = \"wheel\"\n"
          "point = [1.0, 0.0]\n",
          kInertia, kRate, at - width, at, at + width, -kWork / width);
      for (const double rtol : {1e-3, 1e-4, 1e-6, 1e-8}) {
        for (const Method method : {Method::kAuto, Method::kPartitioned, Method::kImplicit}) {
          SimulateOptions options;
          options.method = method;
          options.rtol = rtol;
          options.rate = 10.0;
          const MarkTracks tracks = SimulateMarks(data::ParseScene(scene, "test.toml"), options);
          ASSERT_TRUE(tracks.report.Usable()) << tracks.report.message;
          const double speed = std::hypot(tracks.vx[0].back(), tracks.vy[0].back());
          // Ten tolerances of the speed (docs/accuracy.md) and twenty that the kinks of the second
          // derivative at three knots cost.
          EXPECT_NEAR(speed, left, 30.0 * rtol * kRate)
              << width << " at " << at << ", " << MethodName(method) << " " << rtol;
        }
      }
    }
  }
}

// What tables do not ask for takes no shorter steps: many points of a smooth curve.
TEST(TableWatch, SmoothTablesAreNotSlowedDown) {
  std::string theta, moment;
  for (int k = 0; k <= 400; ++k) {
    const double q = 0.25 * k;
    theta += fmt::format("{}{}", k > 0 ? ", " : "", q);
    moment += fmt::format("{}{:.17g}", k > 0 ? ", " : "", -0.01 * std::sin(0.05 * q));
  }
  const std::string wheel =
      "[scene]\nname = \"smooth\"\nduration = 10.0\n[body.wheel]\nmass = 1.0\ninertia = 0.35\n"
      "[joint.axle]\ninner = \"ground\"\nouter = \"wheel\"\ntheta_rate = 10.0\n";
  SimulateOptions options;
  options.rtol = 1e-4;
  const auto with = SimulateMarks(
      data::ParseScene(
          wheel + fmt::format("[joint.axle.table]\ntheta = [{}]\nmoment = [{}]\n", theta, moment),
          "test.toml"),
      options);
  const auto without = SimulateMarks(data::ParseScene(wheel, "test.toml"), options);
  EXPECT_TRUE(with.report.Usable());
  EXPECT_LE(with.report.steps, without.report.steps + 5);
}

// Beyond its points a table is a straight line that nobody measured: where a run went there is
// told.
TEST(TableWatch, RunsThatLeaveATableSaySo) {
  struct Case {
    double rate, low, high;
    const char* told;
  };
  for (const Case& one : {Case{10.0, -1.0, 5.0,
                               "went to 10.00 rad, but the points of its table "
                               "end at 5.000 rad"},
                          Case{-10.0, -2.0, 5.0,
                               "went to \u221210.00 rad, but the points of its "
                               "table end at \u22122.000 rad"},
                          Case{10.0, -1.0, 9.95, ""}, Case{10.0, 0.0, 300.0, ""}}) {
    for (const Method method : {Method::kAuto, Method::kPartitioned, Method::kImplicit}) {
      SimulateOptions options;
      options.method = method;
      const MarkTracks tracks = SimulateMarks(
          data::ParseScene(
              fmt::format("[scene]\nname = \"beyond\"\nduration = 1.0\n[body.wheel]\nmass = 1.0\n"
                          "inertia = 0.35\n[joint.axle]\ninner = \"ground\"\nouter = \"wheel\"\n"
                          "theta_rate = {}\n[joint.axle.table]\ntheta = [{}, {}]\n"
                          "moment = [0.0, 0.0]\n[mark.rim]\non = \"wheel\"\npoint = [1.0, 0.0]\n",
                          one.rate, one.low, one.high),
              "test.toml"),
          options);
      ASSERT_TRUE(tracks.report.Usable());
      const std::vector<std::string>& told = tracks.report.warnings;
      if (*one.told == '\0') {
        EXPECT_TRUE(told.empty()) << told.front();
        continue;
      }
      ASSERT_EQ(told.size(), 1U) << one.high;
      EXPECT_NE(told[0].find(std::string("the angle of 'axle' ") + one.told), std::string::npos)
          << told[0];
    }
  }
}

}  // namespace
}  // namespace unfurl::sim::table_watch_test
