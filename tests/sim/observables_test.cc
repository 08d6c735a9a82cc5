#include "sim/dynamics/observables.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "sim/methods/simulate.h"
#include "sim/record/record.h"
#include "sim/record/run_recorder.h"
#include "tests/sim/sampled_rows.h"
#include "tests/sim/scenes.h"

namespace unfurl::sim::observables_test {
namespace {

// The multipliers are accelerations times masses: good to the drift that the tolerance allows.
constexpr double kForceError = 1e-7;  // [N], of some 20 to 60

TEST(Observables, PinForceOfAPendulumIsNewtons) {
  constexpr double kMass = 2.0, kRadius = 0.5, kInertia = 0.1, kGravity = 9.81;
  const Model model = ModelFrom(PendulumScene(1.2, kRadius, kInertia));
  SampledRows run(model);
  const SimulateReport report = Simulate(model, Sampled(2.0, 500.0), &run);
  ASSERT_TRUE(report.Usable());
  double largest = 0.0;
  for (std::size_t i = 0; i < run.t.size(); ++i) {
    const double theta = run.At(i, "pivot.theta"), rate = run.At(i, "pivot.theta_rate");
    const double phi = theta - M_PI / 2;
    const double spin =
        -kMass * kGravity * kRadius * std::sin(theta) / (kInertia + kMass * kRadius * kRadius);
    const double ax = kRadius * (-spin * std::sin(phi) - rate * rate * std::cos(phi));
    const double ay = kRadius * (spin * std::cos(phi) - rate * rate * std::sin(phi));
    EXPECT_NEAR(run.At(i, "pivot.pin_force_x"), kMass * ax, kForceError);
    EXPECT_NEAR(run.At(i, "pivot.pin_force_y"), kMass * (ay + kGravity), kForceError);
    EXPECT_NEAR(run.At(i, "pivot.pin_force"), std::hypot(kMass * ax, kMass * (ay + kGravity)),
                kForceError);
    largest = std::max(largest, run.At(i, "pivot.pin_force"));
  }
  EXPECT_NEAR(report.peak_pin_force[0], largest, 1e-3 * largest);
}

TEST(Observables, DrivenSliderTellsItsForces) {
  constexpr double kMass = 2.0, kGravity = 9.81, kArm = 0.2;
  for (const int sign : {1, -1}) {
    const Model model = ModelFrom(
        "[scene]\nname = \"slider\"\nduration = 1.0\n"
        "[body.block]\nmass = 2.0\ninertia = 0.1\n"
        "[joint.slide]\ntype = \"slider\"\ninner = \"ground\"\nouter = \"block\"\n"
        "outer_point = [0.2, 0.0]\nsign = " +
        std::to_string(sign) +
        "\n"
        "[joint.slide.drive]\nposition = \"0.1 * sin(3 * t)\"\n"
        "[gravity]\nacceleration = [0.0, -9.81]\n"
        "[mark.m]\non = \"block\"\n");
    SampledRows run(model);
    ASSERT_TRUE(Simulate(model, Sampled(1.0, 100.0), &run).Usable());
    for (std::size_t i = 0; i < run.t.size(); ++i) {
      const double t = run.t[i];
      EXPECT_NEAR(run.At(i, "slide.travel"), 0.1 * std::sin(3 * t), kForceError);
      EXPECT_NEAR(run.At(i, "slide.travel_rate"), 0.3 * std::cos(3 * t), kForceError);
      EXPECT_NEAR(run.At(i, "slide.drive_force"), -kMass * 0.9 * std::sin(3 * t), kForceError);
      EXPECT_NEAR(run.At(i, "slide.pin_force_x"), 0.0, kForceError);
      EXPECT_NEAR(run.At(i, "slide.pin_force_y"), kMass * kGravity, kForceError);
      EXPECT_NEAR(run.At(i, "slide.hold_moment"), -kMass * kGravity * kArm, kForceError);
    }
  }
}

TEST(Observables, TheLastSampleIsAtTheEndThoughItsTimeIsRounded) {
  constexpr double kDuration = 0.9;  // [s]; 3 / (3 / 0.9) is larger
  const Model model = ModelFrom(PendulumScene(1.2, 0.5, 0.1));
  SampledRows run(model);
  ASSERT_TRUE(Simulate(model, Sampled(kDuration, 3.0 / kDuration), &run).Usable());
  ASSERT_EQ(run.t.size(), 4u);
  EXPECT_EQ(run.t.back(), kDuration);
}

// A beam that thins to half its size: its centre of mass is at 11/28 of its length. Its own end
// gives mass to the body that the joint there is given, which stays the beam's.
TEST(Observables, CentreOfMassOfATaperedBeam) {
  for (const int segments : {6, 12}) {
    for (const bool jointed : {false, true}) {
      const Model model = ModelFrom(
          "[scene]\nname = \"taper\"\nduration = 0.1\n[beam.rod]\nlength = 1.0\nmass = 1.0\n"
          "EI = 10.0\ntaper = 0.5\nsegments = " +
          std::to_string(segments) + "\n" +
          (jointed ? "[joint.root]\ninner = \"ground\"\nouter = \"rod.start\"\n"
                     "[joint.root.spring]\nstiffness = 1.0\n"
                   : "pose = [0, 0, 0]\n"));
      SampledRows run(model);
      ASSERT_TRUE(Simulate(model, Sampled(0.1, 10.0), &run).Usable());
      EXPECT_NEAR(run.At(0, "rod.x"), 11.0 / 28.0, 0.12 / (segments * segments)) << jointed;
    }
  }
}

// A beam laid along an arc of a circle, with its segments' centres on it.
double DeflectionError(int segments, bool tip) {
  constexpr double kRadius = 0.8, kLength = 1.0;
  const Model model = ModelFrom(BeamScene("free", segments));
  std::vector<double> state = model.initial_state;
  const StateIndex& index = model.index;
  for (int k = 0; k < segments; ++k) {
    const double angle = (k + 0.5) * kLength / segments / kRadius;
    const int body = model.beams[0].first + k;
    state[index.x(body)] = kRadius * std::sin(angle);
    state[index.y(body)] = kRadius * (1.0 - std::cos(angle));
    state[index.theta(body)] = angle;
  }
  Dynamics dynamics(model);
  const Motion motion = dynamics.Update(0.0, state.data());
  const CentreLine line(model, model.beams[0]);
  // Sagitta of the chord (to the right of it), and the end's distance from the start's tangent.
  const double truth = tip ? kRadius * (1.0 - std::cos(kLength / kRadius))
                           : -kRadius * (1.0 - std::cos(0.5 * kLength / kRadius));
  return (tip ? line.TipDeflection(motion) : line.MidDeflection(motion)) - truth;
}

TEST(CentreLine, DeflectionsOfAnArcConvergeInSecondOrder) {
  for (const bool tip : {false, true}) {
    for (const int n : {8, 9}) {  // the middle is a segment's centre, or between two
      const double coarse = DeflectionError(n, tip), fine = DeflectionError(2 * n, tip);
      const double order = std::log2(std::fabs(coarse / fine));
      EXPECT_LT(std::fabs(coarse), 0.01) << n << tip;
      if (n == 8) {
        EXPECT_NEAR(order, 2.0, 0.15) << tip;
      }
    }
  }
}

TEST(CentreLine, EveryBeamOfTheDeploymentStartsStraight) {
  // Neighbouring beams' stations lie side by side: none may be taken for another's.
  const Model model = Compile(data::ReadScene(DeploymentPath("clearance")));
  Observables observables(model);
  std::vector<double> state = model.initial_state;
  const std::vector<double> row = observables.Row(0.0, state.data(), model.initial_modes);
  int deflections = 0;
  for (std::size_t q = 0; q < row.size(); ++q) {
    if (!observables.quantities()[q].name.ends_with("_deflection")) continue;
    EXPECT_NEAR(row[q], 0.0, 1e-12) << observables.quantities()[q].name;
    ++deflections;
  }
  EXPECT_EQ(deflections, 8);
  const std::vector<double> shapes = observables.ShapeRow(0.0, state.data());
  std::size_t numbers = 0, beams = 0;
  for (const data::BeamShape& shape : observables.shapes()) {
    numbers += 2 * shape.at.size();
    if (shape.kind == data::ShapeKind::kBeam) beams += 2 * shape.at.size();
  }
  ASSERT_EQ(shapes.size(), numbers);
  ASSERT_EQ(beams, 4u * 2u * (static_cast<std::size_t>(model.beams[0].segments) + 1u));
  // Beam 1 stands on the folded root joint: its ends are its length apart.
  const std::size_t last = 2 * static_cast<std::size_t>(model.beams[0].segments);
  EXPECT_NEAR(std::hypot(shapes[last] - shapes[0], shapes[last + 1] - shapes[1]), 0.8, 1e-12);
}

// Every joint of the deployment joins two bodies: its pin is a point of both outlines.
TEST(CentreLine, OutlinesMeetAtThePins) {
  const Model model = Compile(data::ReadScene(DeploymentPath("clearance")));
  Observables observables(model);
  std::vector<double> state = model.initial_state;
  const std::vector<double>& xy = observables.ShapeRow(0.0, state.data());
  const std::vector<data::BeamShape> shapes = observables.shapes();
  std::size_t at = 0;
  std::vector<std::size_t> first;
  for (const data::BeamShape& shape : shapes) {
    first.push_back(at);
    at += 2 * shape.at.size();
  }
  int pins = 0;
  for (std::size_t p = 0; p < shapes.size(); ++p) {
    if (shapes[p].kind != data::ShapeKind::kPin) continue;
    ++pins;
    int meet = 0;
    for (std::size_t b = 0; b < shapes.size(); ++b) {
      if (shapes[b].kind != data::ShapeKind::kBody) continue;
      double nearest = HUGE_VAL;
      for (std::size_t k = 0; k < shapes[b].at.size(); ++k) {
        nearest = std::min(nearest, std::hypot(xy[first[b] + 2 * k] - xy[first[p]],
                                               xy[first[b] + 2 * k + 1] - xy[first[p] + 1]));
      }
      meet += nearest < 1e-12 ? 1 : 0;
    }
    EXPECT_GE(meet, 2) << shapes[p].name;
  }
  EXPECT_EQ(pins, 4);
}

TEST(CentreLine, ShapePlacesAreBounded) {
  const Model fine = ModelFrom(BeamScene("clamped", 200));
  const std::vector<double> places = ShapePlaces(fine.beams[0]);
  ASSERT_EQ(places.size(), static_cast<std::size_t>(kMostShapePoints));
  EXPECT_EQ(places.front(), 0.0);
  EXPECT_NEAR(places.back(), 1.0, 1e-12);
  EXPECT_TRUE(std::is_sorted(places.begin(), places.end()));
}

TEST(Observables, LeastDrivingMomentIsTheSprings) {
  constexpr double kStiffness = 0.218, kPreload = 1.57, kThetaA = 0.0052;
  const Model model = ModelFrom(LatchingBarScene(kThetaA));
  SampledRows run(model);
  ASSERT_TRUE(Simulate(model, Sampled(2.0, 2000.0), &run).Usable());
  const TorqueMargin& margin = run.observables.margins().of(0);
  EXPECT_TRUE(margin.seen());
  EXPECT_FALSE(margin.resisted());
  // The spring pushes least just before the latch closes; samples come up to one short of it.
  const double at_latch = kStiffness * (kThetaA + kPreload);
  constexpr double kMostRate = 10.0;  // [rad/s]
  EXPECT_GE(margin.least_driving, at_latch);
  EXPECT_LE(margin.least_driving, at_latch + kStiffness * kMostRate / 2000.0);
}

TEST(Observables, TorqueMarginCountsFrictionInFull) {
  constexpr double kStiffness = 0.218, kPreload = 1.57, kThetaA = 0.0052, kFriction = 0.05;
  const Model model = ModelFrom(
      LatchingBarScene(kThetaA, "[joint.hinge.friction]\nmoment = 0.05\ncreep_rate = 0.01\n"));
  SampledRows run(model);
  ASSERT_TRUE(Simulate(model, Sampled(3.0, 2000.0), &run).Usable());
  ASSERT_LT(run.At(run.t.size() - 1, "hinge.theta"), kThetaA) << "it must latch";
  const TorqueMargin& margin = run.observables.margins().of(0);
  ASSERT_TRUE(margin.resisted());
  // Least just before the latch, as the spring is; samples come up to one short of it.
  const double at_latch = kStiffness * (kThetaA + kPreload) / kFriction;
  constexpr double kMostRate = 10.0;  // [rad/s]
  EXPECT_GE(margin.ratio, at_latch);
  EXPECT_LE(margin.ratio, at_latch + kStiffness * kMostRate / 2000.0 / kFriction);
  EXPECT_GE(margin.ratio_theta, kThetaA);
  EXPECT_LE(margin.ratio_theta, kThetaA + kMostRate / 2000.0);
}

// A bump in a tape spring's moment that the joint passes between two samples: what the latch needs
// to get over it does not depend on how often a run is sampled.
TEST(Observables, TorqueMarginDoesNotDependOnSamples) {
  constexpr double kStiffness = 0.218, kPreload = 1.57, kTop = 0.05, kResisting = 0.2;
  const Model model =
      ModelFrom(LatchingBarScene(0.0052,
                                 "[joint.hinge.table]\ntheta = [-1.0, 0.0, 0.05, 0.1, 2.0]\n"
                                 "moment = [0.0, 0.0, 0.2, 0.0, 0.0]\n"));
  RecordOptions options;
  for (const double rate : {2.0, 2000.0}) {
    SimulateOptions simulate;
    simulate.rate = rate;
    options.simulate = simulate;
    const Recording run = Record(std::make_shared<const Model>(model), options);
    ASSERT_TRUE(run.Usable());
    const TorqueMargin& margin = run.recorder->observables().margins().of(0);
    // Near the bump's top; steps are some hundredths of a radian there.
    const double least = kStiffness * (kTop + kPreload) / kResisting;
    EXPECT_NEAR(margin.ratio, least, 0.01 * least) << rate;
    EXPECT_NEAR(margin.ratio_theta, kTop, 0.01) << rate;
    // The least driving moment is the spring's when the latch closes.
    EXPECT_NEAR(margin.least_driving, kStiffness * (0.0052 + kPreload), 1e-6) << rate;
  }
}

TEST(Observables, OnlyWhatIsWanted) {
  const Model model = ModelFrom(LatchingBarScene());
  const Observables some(model, {"hinge.theta*", "energy.total", "tip.x", "tip.?"});
  std::vector<std::string> names;
  for (const data::Quantity& q : some.quantities()) names.push_back(q.name);
  EXPECT_EQ(names, (std::vector<std::string>{"tip.x", "tip.y", "hinge.theta", "hinge.theta_rate",
                                             "energy.total"}));
  EXPECT_EQ(some.marks(), std::vector<std::string>{"tip"});
  EXPECT_TRUE(Observables(model, {"tip.x"}).marks().empty());
  Observables all(model), two(model, {"energy.kinetic", "hinge.pin_force"});
  std::vector<double> state = model.initial_state;
  const std::vector<double> whole = all.Row(0.0, state.data(), model.initial_modes);
  const std::vector<double> part = two.Row(0.0, state.data(), model.initial_modes);
  for (std::size_t q = 0; q < part.size(); ++q) {
    const auto& list = all.quantities();
    const auto found = std::find_if(list.begin(), list.end(), [&](const data::Quantity& x) {
      return x.name == two.quantities()[q].name;
    });
    EXPECT_EQ(part[q], whole[static_cast<std::size_t>(found - list.begin())]);
  }
  try {
    Observables(model, {"hinge.thet"});
    FAIL() << "an unknown quantity must be refused";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("did you mean 'hinge.theta'?"), std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace unfurl::sim::observables_test
