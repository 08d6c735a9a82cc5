// What a scene's instruments read, against closed forms.
#include "sim/dynamics/sensors.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/sim/sampled_rows.h"
#include "tests/sim/scenes.h"

namespace unfurl::sim::sensors_test {
namespace {

// A compound pendulum: tangential and radial specific force at the tip, and its rate.
TEST(Sensors, OfAPendulum) {
  constexpr double kRadius = 0.5, kMass = 2.0, kInertia = 0.1, kGravity = 9.81;
  const Model model =
      ModelFrom(PendulumScene(1.2, kRadius, kInertia) +
                "[sensor.along]\nkind = \"accelerometer\"\non = \"bar\"\npoint = [0.5, 0.0]\n"
                "[sensor.across]\nkind = \"accelerometer\"\non = \"bar\"\npoint = [0.5, 0.0]\n"
                "axis = 1.5707963267948966\n"
                "[sensor.bare]\nkind = \"accelerometer\"\non = \"bar\"\npoint = [0.5, 0.0]\n"
                "axis = 1.5707963267948966\ngravity = false\n"
                "[sensor.gyro]\nkind = \"gyroscope\"\non = \"bar\"\n");
  SampledRows run(model);
  ASSERT_TRUE(Simulate(model, Sampled(2.0, 200.0), &run).Usable());
  const double length = 2.0 * kRadius;
  for (std::size_t i = 0; i < run.t.size(); ++i) {
    const double theta = run.At(i, "pivot.theta"), rate = run.At(i, "pivot.theta_rate");
    const double spin =
        -kMass * kGravity * kRadius * std::sin(theta) / (kInertia + kMass * kRadius * kRadius);
    constexpr double kError = 2e-7;  // [m/s^2]: of the run's own tolerance, and of the difference
    EXPECT_NEAR(run.At(i, "bare.reading"), length * spin, kError);
    EXPECT_NEAR(run.At(i, "across.reading"), length * spin + kGravity * std::sin(theta), kError);
    EXPECT_NEAR(run.At(i, "along.reading"), -length * rate * rate - kGravity * std::cos(theta),
                kError);
    EXPECT_NEAR(run.At(i, "gyro.reading"), rate, 1e-12);
  }
}

// A free fall: a specific force of nothing, whatever turns.
TEST(Sensors, AFallingBodyFeelsNothing) {
  const Model model = ModelFrom(
      "[scene]\nname = \"fall\"\nduration = 1.0\n"
      "[body.stone]\nmass = 1.0\ninertia = 0.1\npose = [0, 0, 0.3]\nvelocity = [1, 2, 5]\n"
      "[gravity]\nacceleration = [0.0, -9.81]\n"
      "[sensor.centre]\nkind = \"accelerometer\"\non = \"stone\"\naxis = 0.7\n"
      "[sensor.edge]\nkind = \"accelerometer\"\non = \"stone\"\npoint = [0.2, 0.0]\n");
  SampledRows run(model);
  ASSERT_TRUE(Simulate(model, Sampled(0.5, 50.0), &run).Usable());
  for (std::size_t i = 0; i < run.t.size(); ++i) {
    EXPECT_NEAR(run.At(i, "centre.reading"), 0.0, 1e-8);
    EXPECT_NEAR(run.At(i, "edge.reading"), -0.2 * 25.0, 1e-7);
  }
}

// A cantilever held at an angle, with a body at its end at another: both ends' axes are the beam's
// tangent. As it is let go nothing moves along it yet, and what is left is gravity.
std::string Leaning(const std::string& kind, double tip_angle, const std::string& more) {
  return fmt::format(
      "[scene]\nname = \"leaning\"\nduration = 0.3\n[gravity]\nacceleration = [0.0, -9.81]\n"
      "[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 10.0\ndamping = 0.01\n{}"
      "[weld.root]\ninner = \"ground\"\nouter = \"rod.start\"\nangle = 0.5\n"
      "[body.tip]\nmass = 0.3\ninertia = 0.01\n"
      "[weld.tip]\ninner = \"rod.end\"\nouter = \"tip\"\nangle = {}\n{}",
      kind, tip_angle, more);
}

TEST(Sensors, AxesOfWeldedEndsAreTheTangents) {
  for (const char* kind : {"segments = 8\n", "model = \"kirchhoff\"\norder = 4\n"}) {
    const Model model =
        ModelFrom(Leaning(kind, 1.0,
                          "[sensor.start]\nkind = \"accelerometer\"\non = \"rod.start\"\n"
                          "[sensor.end]\nkind = \"accelerometer\"\non = \"rod.end\"\n"
                          "[sensor.at]\nkind = \"accelerometer\"\non = \"rod\"\nat = 1.0\n"));
    SampledRows run(model);
    ASSERT_TRUE(Simulate(model, Sampled(0.01, 100.0), &run).Usable()) << kind;
    for (const char* name : {"start.reading", "end.reading", "at.reading"}) {
      EXPECT_NEAR(run.At(0, name), 9.81 * std::sin(0.5), 1e-6) << kind << name;
    }
  }
}

// A force that turns with the beam's end and a slot in it do not ask at which angle a body, alike
// from all sides, is welded there.
TEST(Sensors, NothingHangsOnTheAngleOfARoundBody) {
  const std::string more =
      "[force.f]\non = \"rod.end\"\nforce = [3.0, 1.0]\nframe = \"body\"\n"
      "[body.bead]\nmass = 0.1\ninertia = 0.001\n"
      "[joint.slot]\ntype = \"slider\"\ninner = \"rod.end\"\nouter = \"bead\"\naxis = 0.3\n"
      "travel = 0.2\n[joint.slot.damper]\ndamping = 0.1\n";
  for (const char* kind : {"segments = 8\n", "model = \"kirchhoff\"\norder = 4\n"}) {
    const Model along = ModelFrom(Leaning(kind, 0.0, more));
    const Model turned = ModelFrom(Leaning(kind, 1.0, more));
    SampledRows a(along), b(turned);
    ASSERT_TRUE(Simulate(along, Sampled(0.3, 50.0), &a).Usable()) << kind;
    ASSERT_TRUE(Simulate(turned, Sampled(0.3, 50.0), &b).Usable()) << kind;
    for (std::size_t i = 0; i < a.t.size(); ++i) {
      for (const char* name : {"bead.x", "bead.y", "slot.travel"}) {
        EXPECT_NEAR(a.At(i, name), b.At(i, name), 1e-6) << kind << name;
      }
    }
  }
}

// A gyroscope between the middles of two segments: second order in their length.
TEST(Sensors, RatesOnSegmentsConvergeInSecondOrder) {
  const auto rates = [](const std::string& kind) {
    const Model model =
        ModelFrom(Leaning(kind, 0.0,
                          "[sensor.inside]\nkind = \"gyroscope\"\non = \"rod\"\nat = 0.23\n"
                          "[sensor.near]\nkind = \"gyroscope\"\non = \"rod\"\nat = 0.97\n"));
    SampledRows run(model);
    EXPECT_TRUE(Simulate(model, Sampled(0.3, 50.0), &run).Usable()) << kind;
    std::vector<double> out;
    for (std::size_t i = 0; i < run.t.size(); ++i) {
      for (const char* name : {"inside.reading", "near.reading"}) out.push_back(run.At(i, name));
    }
    return out;
  };
  const std::vector<double> smooth = rates("model = \"kirchhoff\"\norder = 8\n");
  const auto error = [&](int segments) {
    const std::vector<double> found = rates(fmt::format("segments = {}\n", segments));
    double sum = 0.0;
    for (std::size_t i = 0; i < found.size(); ++i) sum += std::pow(found[i] - smooth[i], 2);
    return std::sqrt(sum);
  };
  EXPECT_GT(error(9) / error(18), 3.0);  // 4 in second order, 2 in first
}

// At rest, places inside of segments: a torque M at a lifts a cantilever's end by M a (L - a / 2) /
// EI, and a pulled line stretches evenly.
TEST(Sensors, PlacesInsideSegmentsAreOfSecondOrder) {
  for (const int segments : {7, 9, 12}) {
    const Model model = ModelFrom(fmt::format(
        "[scene]\nname = \"at rest\"\nduration = 4.0\n[beam.rod]\nlength = 1.0\nmass = 1.0\n"
        "EI = 10.0\ndamping = 0.05\nsegments = {}\naxial = \"elastic\"\nEA = 400.0\n"
        "[weld.root]\ninner = \"ground\"\nouter = \"rod.start\"\n"
        "[force.turn]\non = \"rod\"\nat = 0.41\ntorque = 0.05\n"
        "[force.pull]\non = \"rod.end\"\nforce = [\"0.1 * smoothstep(t)\", 0]\n"
        "[mark.end]\non = \"rod.end\"\n[mark.seen]\non = \"rod\"\nat = 0.36\n",
        segments));
    SampledRows run(model);
    ASSERT_TRUE(Simulate(model, Sampled(4.0, 10.0), &run).Usable()) << segments;
    const std::size_t last = run.t.size() - 1;
    constexpr double kLift = 0.05 * 0.41 * (1.0 - 0.5 * 0.41) / 10.0;
    constexpr double kPulled = 0.01;  // of the lift: what the pull straightens, F L^2 / EI
    EXPECT_NEAR(run.At(last, "end.y") / kLift, 1.0, 0.6 / (segments * segments) + kPulled)
        << segments;
    // But for what bending shortens.
    EXPECT_NEAR(run.At(last, "seen.x"), 0.36 * (1.0 + 0.1 / 400.0), kLift * kLift) << segments;
  }
}

// A wheel that turns for a million turns, and one of a tenth of a millisecond: r omega^2, however
// long the scene. The angle itself is known to 1e-16 of what it has become.
TEST(Sensors, CentripetalHoweverLongTheScene) {
  struct Case {
    double duration, rate;  // [s], [rad/s]
  };
  for (const auto& [duration, rate] : {Case{1e6, 6.0}, Case{1e-4, 6.0}, Case{1.0, 5000.0}}) {
    const Model model = ModelFrom(fmt::format(
        "[scene]\nname = \"wheel\"\nduration = {}\n"
        "[body.wheel]\nmass = 1.0\ninertia = 0.1\npose = [0, 0, 0]\nvelocity = [0, 0, {}]\n"
        "[sensor.rim]\nkind = \"accelerometer\"\non = \"wheel\"\npoint = [0.5, 0.0]\n",
        duration, rate));
    SampledRows run(model);
    ASSERT_TRUE(Simulate(model, Sampled(duration, 10.0 / duration), &run).Usable());
    for (std::size_t i = 0; i < run.t.size(); ++i) {
      EXPECT_NEAR(run.At(i, "rim.reading") / (-0.5 * rate * rate), 1.0, 1e-4) << duration;
    }
  }
}

// A force across the end of a cantilever at rest bends it most where it is held, F L / EI, and that
// is where gauges are. The end's balance of moments is exact on any mesh.
TEST(Sensors, CurvatureWhereACantileverIsHeld) {
  for (const char* kind :
       {"segments = 2\n", "segments = 5\n", "model = \"kirchhoff\"\norder = 3\n"}) {
    for (const bool mirrored : {false, true}) {
      const std::string held = mirrored ? "end" : "start", loaded = mirrored ? "start" : "end";
      const Model model = ModelFrom(
          std::string("[scene]\nname = \"beam\"\nduration = 4.0\n[beam.rod]\nlength = 2.0\n"
                      "mass = 0.1\nEI = 10.0\ndamping = 0.05\n") +
          kind + "[weld.root]\ninner = \"ground\"\nouter = \"rod." + held + "\"\n" +
          "[force.f]\non = \"rod." + loaded + "\"\nforce = [0, \"0.01 * smoothstep(t)\"]\n" +
          "[sensor.k]\nkind = \"curvature\"\non = \"rod\"\nat = " + (mirrored ? "1.0" : "0.0") +
          "\n");
      SampledRows run(model);
      ASSERT_TRUE(Simulate(model, Sampled(4.0, 10.0), &run).Usable()) << kind;
      // The beam shortens what the force's arm is by the square of its slope, 2e-3.
      constexpr double kCurvature = 0.01 * 2.0 / 10.0;
      EXPECT_NEAR(run.At(run.t.size() - 1, "k.reading"), kCurvature, 1e-4 * kCurvature)
          << kind << held;
    }
  }
}

// A cantilever under a moment M at its end: curvature M / EI everywhere; under a force F, F (L - s)
// / EI; strain minus the height times that. Damped to rest; segments and smooth beams.
TEST(Sensors, CurvatureAndStrainOfACantilever) {
  for (const char* kind : {"segments = 24\n", "model = \"kirchhoff\"\norder = 4\n"}) {
    const std::string scene =
        std::string(
            "[scene]\nname = \"beam\"\nduration = 4.0\n[beam.rod]\nlength = 1.0\n"
            "mass = 1.0\nEI = 10.0\ndamping = 0.05\n") +
        kind + "[weld.root]\ninner = \"ground\"\nouter = \"rod.start\"\n" +
        "[sensor.k]\nkind = \"curvature\"\non = \"rod\"\nat = 0.37\n"
        "[sensor.root]\nkind = \"curvature\"\non = \"rod\"\nat = 0.0\n"
        "[sensor.gauge]\nkind = \"strain_gauge\"\non = \"rod\"\nat = 0.5\nheight = 0.002\n";
    {
      const Model model = ModelFrom(scene + "[force.m]\non = \"rod.end\"\ntorque = 0.05\n");
      SampledRows run(model);
      ASSERT_TRUE(Simulate(model, Sampled(4.0, 10.0), &run).Usable()) << kind;
      const std::size_t last = run.t.size() - 1;
      for (const char* name : {"k.reading", "root.reading"}) {
        EXPECT_NEAR(run.At(last, name), 0.005, 2e-5) << kind << name;
      }
      EXPECT_NEAR(run.At(last, "gauge.reading"), -0.002 * 0.005, 4e-8) << kind;
    }
    const Model model = ModelFrom(scene + "[force.f]\non = \"rod.end\"\nforce = [0, 0.1]\n");
    SampledRows run(model);
    ASSERT_TRUE(Simulate(model, Sampled(4.0, 10.0), &run).Usable()) << kind;
    const std::size_t last = run.t.size() - 1;
    EXPECT_NEAR(run.At(last, "k.reading"), 0.01 * 0.63, 1e-4) << kind;
    EXPECT_NEAR(run.At(last, "gauge.reading"), -0.002 * 0.01 * 0.5, 2e-7) << kind;
  }
}

// On a smooth beam and on its segments an accelerometer feels the same motion.
TEST(Sensors, AnAccelerometerOnABeamFeelsTheSecondDerivativeOfItsMark) {
  for (const char* kind : {"segments = 6\n", "model = \"kirchhoff\"\norder = 3\n"}) {
    const Model model =
        ModelFrom(std::string("[scene]\nname = \"beam\"\nduration = 1.0\n[beam.rod]\nlength = 1.0\n"
                              "mass = 0.5\nEI = 2.0\n") +
                  kind +
                  "[joint.pivot]\ninner = \"ground\"\nouter = \"rod.start\"\n"
                  "[gravity]\nacceleration = [0.0, -9.81]\n[mark.m]\non = \"rod\"\nat = 0.4\n"
                  "[sensor.x]\nkind = \"accelerometer\"\non = \"rod\"\nat = 0.4\ngravity = false\n"
                  "[sensor.y]\nkind = \"accelerometer\"\non = \"rod\"\nat = 0.4\ngravity = false\n"
                  "axis = 1.5707963267948966\n");
    constexpr double kRate = 20000.0;
    SampledRows run(model);
    ASSERT_TRUE(Simulate(model, Sampled(0.4, kRate), &run).Usable()) << kind;
    for (std::size_t i = 1000; i + 1 < run.t.size(); i += 500) {
      auto second = [&](const char* name) {
        return (run.At(i + 1, name) - run.At(i - 1, name)) * kRate / 2.0;
      };
      // The magnitude does not depend on the axes.
      const double ax = second("m.vx"), ay = second("m.vy");
      const double size = std::hypot(run.At(i, "x.reading"), run.At(i, "y.reading"));
      EXPECT_NEAR(size, std::hypot(ax, ay), 1e-4 * std::hypot(ax, ay) + 1e-4) << kind << i;
    }
  }
}

TEST(Sensors, WhatCannotBeReadIsNamed) {
  auto message = [](const std::string& sensor) {
    try {
      ModelFrom(PendulumScene(1.0) + "[sensor.s]\n" + sensor);
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("none");
  };
  using ::testing::HasSubstr;
  EXPECT_THAT(message("kind = \"thermometer\"\non = \"bar\"\n"), HasSubstr("thermometer"));
  EXPECT_THAT(message("kind = \"curvature\"\non = \"bar\"\n"), HasSubstr("does not bend"));
  EXPECT_THAT(message("kind = \"gyroscope\"\non = \"ground\"\n"), HasSubstr("reads nothing"));
  EXPECT_THAT(message("kind = \"gyroscope\"\non = \"bra\"\n"), HasSubstr("bar"));
  EXPECT_THAT(message("kind = \"strain_gauge\"\non = \"bar\"\n"), HasSubstr("does not bend"));
}

}  // namespace
}  // namespace unfurl::sim::sensors_test
