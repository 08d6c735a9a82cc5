// What a run must not call good: every case here was once wrong and "good", or never ended.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "base/error.h"
#include "scenes.h"
#include "sim/implicit/equilibrium.h"
#include "sim/implicit/modes.h"
#include "sim/methods/run_judge.h"
#include "sim/methods/simulate.h"

namespace unfurl::sim::judged_test {
namespace {

// The state at the end, and the balance's residual there.
struct Last : Observer {
  void OnSample(double, double* y, const std::vector<LatchMode>&) override {
    state.assign(y, y + size);
  }
  explicit Last(const Model& model) : size(model.index.size()) {}
  int size;
  std::vector<double> state;
};

// A free body of 1 kg that a force pushes along x from rest, at t = 0.02 s [m/s].
double SpeedAfter(const std::string& force, Method method, int order) {
  const Model model = ModelFrom(
      "[scene]\nname = \"pulse\"\nduration = 0.02\n"
      "[body.b]\nmass = 1.0\ninertia = 1.0\n"
      "[force.f]\non = \"b\"\nforce = [" +
      force + ", 0.0]\n");
  SimulateOptions options;
  options.method = method;
  options.order = order;
  options.rate = 50.0;
  Last last(model);
  const SimulateReport report = Simulate(model, options, &last);
  EXPECT_TRUE(report.Usable()) << force << ": " << report.message;
  return last.state[model.index.vx(model.bodies[0].centre.body)];
}

// Impulses of 2 N s, as wide as 3 ms and as short as 1 ns, beginning at 1 ms: there a double of the
// time resolves 1e-10 of a nanosecond.
TEST(Pulses, ImpulsesAreRightHoweverShort) {
  const double begin = 1e-3;
  const struct {
    Method method;
    int order;
  } kWays[] = {{Method::kAuto, 0},
               {Method::kProjected, 4},
               {Method::kProjected, 8},
               {Method::kPartitioned, 0}};
  for (const double width : {3e-3, 1e-5, 1e-7, 1e-9}) {
    const double end = begin + width, middle = begin + 0.5 * width;
    const double impulse = 2.0;
    const double f = impulse / (end - begin);
    const std::string shapes[] = {
        fmt::format("\"{:.17g} * (step(t - {:.17g}) - step(t - {:.17g}))\"", f, begin, end),
        fmt::format("\"{:.17g} * (step({:.17g} - t) - step({:.17g} - t))\"", f, end, begin),
        fmt::format("{{t = [{:.17g}, {:.17g}, {:.17g}], value = [0.0, {:.17g}, 0.0], "
                    "interpolation = \"linear\"}}",
                    begin, middle, end, 2.0 * f),
        fmt::format("\"{:.17g} * (smoothstep((t - {:.17g}) / {:.17g}) - smoothstep((t - {:.17g}) / "
                    "{:.17g}))\"",
                    f, begin, width, end, width),
        fmt::format("\"{:.17g} * max(0, min(t - {:.17g}, {:.17g} - t)) / {:.17g}\"", 2.0 * f, begin,
                    end, 0.5 * width)};
    for (const std::string& shape : shapes) {
      for (const auto& way : kWays) {
        // The fourth order integrates the quintic to 2e-7 only.
        if (way.order == 4 && shape.find("smooth") != std::string::npos) continue;
        EXPECT_NEAR(SpeedAfter(shape, way.method, way.order), impulse, 1e-9 * impulse)
            << width << " " << shape << " " << MethodName(way.method) << " " << way.order;
      }
    }
  }
}

// A free beam at rest with a force at its tip: as many steps at any angle, to a factor of two.
TEST(SceneAtRest, LeavesTheStartAtAnyAngle) {
  const auto steps = [](double angle) {
    const Model model =
        ModelFrom(fmt::format("[scene]\nname = \"spaghetti\"\nduration = 1.0\n"
                              "[beam.rod]\nlength = 10.0\nmass = 10.0\nEI = 500.0\nsegments = 8\n"
                              "pose = [6.0, 0.0, {:.17g}]\n"
                              "[force.push]\non = \"rod.end\"\nforce = [{:.17g}, {:.17g}]\n",
                              angle, -8.0 * std::sin(angle), 8.0 * std::cos(angle)));
    SimulateOptions options;
    const SimulateReport report = Simulate(model, options, nullptr);
    EXPECT_TRUE(report.Usable()) << angle << ": " << report.message;
    return report.steps;
  };
  const long level = steps(0.0);
  for (const double angle : {0.3, 0.9272952180016122, 2.0, -1.1}) {
    const long inclined = steps(angle);
    EXPECT_LE(inclined, 2 * level) << angle;
    EXPECT_LE(level, 2 * inclined) << angle;
  }
}

// A bar of inertia 0.35 kg m^2 about its pivot, whose rate is driven.
std::string DrivenBar(const std::string& drive) {
  return "[scene]\nname = \"drive\"\nduration = 0.5\n"
         "[body.bar]\nmass = 1.0\ninertia = 0.1\n"
         "[joint.pivot]\ninner = \"ground\"\nouter = \"bar\"\nouter_point = [-0.5, 0.0]\n"
         "[joint.pivot.drive]\n" +
         drive + "\n";
}

TEST(Drives, PositionThatJumpsIsRefused) {
  for (const char* jump :
       {"position = \"0.2 * step(t - 0.1)\"", "position = \"t - ramp(t - 0.1) * step(t - 0.3)\""}) {
    try {
      ModelFrom(DrivenBar(jump));
      ADD_FAILURE() << jump;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("jumps at t = 0."), std::string::npos)
          << error.what();
      EXPECT_NE(std::string(error.what()).find("pivot"), std::string::npos);
    }
  }
}

// Pulses that lie between the places that any step would look at: int exp(-(t/w)^2) / w dt =
// sqrt(pi), and others in closed form.
TEST(Pulses, SmoothOnesAreSeenHoweverShort) {
  const double area = std::sqrt(M_PI);
  for (const double width : {2e-6, 3e-8, 1e-9}) {
    for (const double at : {0.0041, 0.01234567}) {
      const std::string bell = fmt::format("exp(-((t - {:.17g}) / {:.17g})^2)", at, width);
      const struct {
        std::string shape;
        double impulse;
      } kCases[] = {
          {fmt::format("\"{} / {:.17g}\"", bell, width), area},
          {fmt::format("\"{} / {:.17g} + 7\"", bell, width), area + 7.0 * 0.02},
          {fmt::format("\"1 / (1 + ((t - {:.17g}) / {:.17g})^2) / {:.17g}\"", at, width, width),
           std::atan(at / width) + std::atan((0.02 - at) / width)},
          {fmt::format("\"(1 - tanh((t - {:.17g}) / {:.17g})^2) / {:.17g}\"", at, width, width),
           2.0},
          {fmt::format("\"step({} - 0.5) / {:.17g}\"", bell, width),
           2.0 * std::sqrt(std::log(2.0))}};
      for (const auto& k : kCases) {
        for (const Method method : {Method::kAuto, Method::kPartitioned, Method::kImplicit}) {
          // Steps may be 1e-6 of 250 m/s off here; those of high order are better.
          const double accuracy = method == Method::kImplicit ? 1e-4 : 1e-6;
          EXPECT_NEAR(SpeedAfter(k.shape, method, 0), k.impulse, accuracy * k.impulse)
              << width << " " << k.shape << " " << MethodName(method);
        }
      }
    }
  }
}

// A mass on a spring that is drawn to three times its length and let go: it passes through the
// spring's other end, where the force turns about. Between, harmonic: u = 1 + 2 cos(10 t - phase).
TEST(Springs, EndsThatPassThroughOneAnother) {
  const double first = 2.0 * M_PI / 30.0, again = 2.0 * first;  // times of passing [s]
  for (const double rtol : {1e-3, 1e-4, 1e-6, 1e-8}) {
    for (const Method method : {Method::kAuto, Method::kPartitioned, Method::kImplicit}) {
      SimulateOptions options;
      options.method = method;
      options.rtol = rtol;
      options.rate = 100.0;
      const MarkTracks tracks = SimulateMarks(
          data::ParseScene("[scene]\nname = \"pass\"\nduration = 1.0\n"
                           "[body.b]\nmass = 1.0\ninertia = 1.0\npose = [3.0, 0.1, 0.0]\n"
                           "[spring.s]\na = \"ground\"\na_point = [0.0, 0.1]\nb = \"b\"\n"
                           "stiffness = 100.0\nfree_length = 1.0\n[mark.m]\non = \"b\"\n",
                           "test.toml"),
          options);
      ASSERT_TRUE(tracks.report.Usable()) << tracks.report.message;
      for (std::size_t k = 0; k < tracks.t.size(); ++k) {
        const double t = tracks.t[k],
                     passes = t < first ? 0.0 : std::floor((t - first) / again) + 1;
        const double since = t - (passes > 0.0 ? first + (passes - 1.0) * again : 0.0);
        const double phase = passes > 0.0 ? 2.0 * M_PI / 3.0 : 0.0;
        const double u = 1.0 + 2.0 * std::cos(10.0 * since - phase);
        // Ten tolerances of 3 m, as all motions keep (docs/accuracy.md).
        EXPECT_NEAR(tracks.x[0][k], std::fmod(passes, 2.0) == 0.0 ? u : -u, 30.0 * rtol)
            << MethodName(method) << " " << rtol << " at " << t;
      }
    }
  }
}

// Where the rate jumps, the impulse and its work go with it: 1/2 I w^2 in closed form.
TEST(Drives, RateThatJumpsCarriesItsWork) {
  for (const char* kink : {"rate = \"3 * step(t - 0.1)\"", "position = \"3 * ramp(t - 0.1)\""}) {
    for (const Method method : {Method::kProjected, Method::kPartitioned, Method::kImplicit}) {
      const Model model = ModelFrom(DrivenBar(kink));
      SimulateOptions options;
      options.method = method;
      Last last(model);
      const SimulateReport report = Simulate(model, options, &last);
      ASSERT_TRUE(report.Usable()) << kink << MethodName(method) << report.message;
      const int body = model.bodies[0].centre.body;
      EXPECT_NEAR(last.state[model.index.omega(body)], 3.0, 1e-6) << kink;
      EXPECT_NEAR(last.state[model.index.theta(body)], 3.0 * 0.4, 1e-6) << kink;
      EXPECT_NEAR(last.state[model.index.extra(kExtraWork)], 0.5 * (0.1 + 0.25) * 9.0, 1e-5)
          << kink << " " << MethodName(method);
      EXPECT_LT(report.energy_residual, 1e-5);
    }
  }
}

std::string BarWithLatch(double theta) {
  return fmt::format(
      "[scene]\nname = \"inside\"\nduration = 0.1\n{}"
      "[body.bar]\nmass = 0.5\ninertia = 0.02\n"
      "[joint.hinge]\ninner = \"ground\"\nouter = \"bar\"\nouter_point = [-0.3, 0.0]\n"
      "theta = {}\n[joint.hinge.spring]\nstiffness = 0.218\npreload = 1.57\n"
      "[joint.hinge.latch]\ntheta_a = 0.005\ntheta_b = 0.005\nlever = 0.02\ncontact = \"lock\"\n",
      kContact, theta);
}

TEST(Start, InsideAStopIsRefusedByName) {
  try {
    ModelFrom(BarWithLatch(-90.0));
    ADD_FAILURE() << "a start 90 rad beyond the stop";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("'hinge' by 90 rad"), std::string::npos)
        << error.what();
  }
  // What the spring may have pressed in is only said; within the clearance nothing is.
  EXPECT_EQ(ModelFrom(BarWithLatch(-0.0050005)).warnings.size(), 1u);
  EXPECT_TRUE(ModelFrom(BarWithLatch(0.0)).warnings.empty());
}

TEST(Start, LoosePartsAreNamed) {
  const std::string bodies =
      "[scene]\nname = \"loose\"\nduration = 0.1\n"
      "[body.a]\nmass = 1.0\ninertia = 1.0\n"
      "[body.b]\nmass = 1.0\ninertia = 1.0\npose = [1.0, 0.0, 0.0]\n";
  const Model apart = ModelFrom(bodies);
  ASSERT_EQ(apart.warnings.size(), 1u);
  EXPECT_NE(apart.warnings[0].find("'a' and 'b'"), std::string::npos) << apart.warnings[0];
  const std::string spring = "[spring.s]\na = \"a\"\nb = \"b\"\nstiffness = 1.0\n";
  EXPECT_TRUE(ModelFrom(bodies + spring).warnings.empty());
  const std::string gravity = "[gravity]\nacceleration = [0.0, -9.81]\n";
  const Model falls = ModelFrom(bodies + spring + gravity);
  ASSERT_EQ(falls.warnings.size(), 1u);
  EXPECT_NE(falls.warnings[0].find("'a' to the ground"), std::string::npos) << falls.warnings[0];
  EXPECT_TRUE(ModelFrom(PendulumScene(0.3)).warnings.empty());
}

// A beam between a pin and a pin in a slot that a force P pulls along the beam:
//   omega_k^2 = (k pi / L)^4 EI / rho + (k pi / L)^2 P / rho   (Euler and Bernoulli)
std::string PulledBeam(double P, int segments, const std::string& form) {
  return fmt::format(
      "[scene]\nname = \"pulled\"\nduration = 1.0\n"
      "[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 10.0\nsegments = {}\nform = \"{}\"\n"
      "[joint.left]\ninner = \"ground\"\nouter = \"rod.start\"\n"
      "[joint.right]\ntype = \"pin_in_slot\"\ninner = \"ground\"\nouter = \"rod.end\"\n"
      "travel = 1.0\n"
      "[force.pull]\non = \"rod.end\"\nforce = [{:.17g}, 0.0]\n",
      segments, form, P);
}

double PulledError(double P, int segments, const std::string& form, int k) {
  const Model model = ModelFrom(PulledBeam(P, segments, form));
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state, rate(y.size());
  dynamics.RightSide(0.0, y.data(), rate.data());
  const ModesReport report = FindModes(&dynamics, y.data(), k);
  const double wave = k * M_PI;
  const double exact = std::sqrt(std::pow(wave, 4) * 10.0 + wave * wave * P);
  return 2.0 * M_PI * report.modes.at(static_cast<std::size_t>(k) - 1).frequency / exact - 1.0;
}

TEST(TensionedBeam, FrequenciesConvergeToTheClosedForm) {
  for (const double P : {0.0, 100.0, 1000.0}) {
    for (const int k : {1, 2}) {
      const double coarse = PulledError(P, 8, "chord", k), fine = PulledError(P, 16, "chord", k);
      std::printf("found: P = %g N, mode %d: error %.5f with 8 segments, %.5f with 16\n", P, k,
                  coarse, fine);
      EXPECT_LT(std::fabs(fine), 0.02);
      EXPECT_NEAR(std::log2(coarse / fine), 2.0, 0.25) << P << " " << k;
    }
  }
}

// Tension never takes the bending stiffness of a chord away; with the constraint along the inboard
// axis it is EI (1 - P l^2 / (4 EI)).
TEST(TensionedBeam, StaysStableInAnyTension) {
  const auto growth = [](const std::string& form) {
    // P l^2 / EI = 20 with 4 segments.
    const Model model = ModelFrom(PulledBeam(20.0 * 10.0 * 16.0, 4, form));
    Dynamics dynamics(model);
    std::vector<double> y = model.initial_state, rate(y.size());
    dynamics.RightSide(0.0, y.data(), rate.data());
    return FindModes(&dynamics, y.data(), 2).modes.at(0).growth;
  };
  EXPECT_EQ(growth("chord"), 0.0);
  EXPECT_GT(growth("gradient"), 1.0);
}

// A soft boom that a hub spins: its tension asks for more segments than it has.
TEST(AxialForce, StopsWhereTheMeshDoesNotResolveIt) {
  const auto run = [](int segments, double EI) {
    const Model model = ModelFrom(
        fmt::format("[scene]\nname = \"boom\"\nduration = 3.0\n"
                    "[body.hub]\nmass = 1000.0\ninertia = 1000.0\nvelocity = [0.0, 0.0, 2.0]\n"
                    "[beam.boom]\nlength = 10.0\nmass = 0.5\nEI = {}\nsegments = {}\n"
                    "[weld.root]\ninner = \"hub\"\nouter = \"boom.start\"\n",
                    EI, segments));
    return Simulate(model, {}, nullptr);
  };
  const SimulateReport soft = run(16, 0.01);
  EXPECT_EQ(soft.status, SimulateStatus::kMeshCoarse);
  EXPECT_NE(soft.message.find("'boom' is stretched"), std::string::npos) << soft.message;
  EXPECT_NE(soft.message.find("use segments = "), std::string::npos) << soft.message;
  // P = m w^2 L / 2 at the root, 10 N; l = 10 / 16 m.
  EXPECT_NEAR(soft.axial[0].ratio, 390.6, 4.0);
  const SimulateReport stiff = run(16, 100.0);
  EXPECT_TRUE(stiff.Usable()) << stiff.message;
  EXPECT_TRUE(stiff.warnings.empty());
}

// Pressed beyond its Euler load a beam may buckle, which is no failure.
TEST(AxialForce, TellsBucklingFromAMeshTooCoarse) {
  const Model model = ModelFrom(PulledBeam(-1.2 * M_PI * M_PI * 10.0, 16, "chord"));
  SimulateOptions options;
  const SimulateReport report = Simulate(model, options, nullptr);
  EXPECT_TRUE(report.Usable()) << report.message;
  ASSERT_EQ(report.warnings.size(), 1u);
  EXPECT_NE(report.warnings[0].find("its Euler load"), std::string::npos) << report.warnings[0];
}

// A swinging pendulum whose velocities grow by 2% out of nothing gains 4% of its kinetic energy:
// told; one whose energy is what it was is not.
TEST(Judge, EnergyThatIsNotBalancedIsNotGood) {
  const Model model = Compile(data::ReadScene(
      std::string(UNFURL_SOURCE_DIR) + "/data/sets/double_pendulum/scene.toml", {}));
  struct FinalState : Observer {
    std::vector<double> y;
    std::vector<LatchMode> at_end;
    void OnSample(double, double* state, const std::vector<LatchMode>& modes) override {
      std::copy_n(state, y.size(), y.begin());
      at_end = modes;
    }
  } last;
  last.y = model.initial_state;
  SimulateOptions options;
  options.duration = 0.5;
  options.rtol = 1e-9;
  ASSERT_TRUE(Simulate(model, options, &last).Usable());
  ErrorScale scale;
  scale.rtol = 1e-9;
  RunJudge judge(model, scale, false);
  judge.Look(0.0, model.initial_state.data(), last.at_end);
  judge.Look(0.5, last.y.data(), last.at_end);
  EXPECT_EQ(judge.Complaint(), "");
  for (int k = 0; k < 3 * model.rigid_bodies.count; ++k) last.y[model.index.vx(0) + k] *= 1.02;
  judge.Look(0.6, last.y.data(), last.at_end);
  EXPECT_NE(judge.Complaint().find("balance of energy"), std::string::npos) << judge.Complaint();
}

// Loose steps of the deployment, undamped and with every latch: its heat was off by 20 J.
TEST(Judge, HeatOfTheDeploymentIsRightAtLooseTolerances) {
  const Model model = Compile(data::ReadScene(DeploymentPath("suspension"),
                                              {"beam.beam1.segments=4", "beam.beam2.segments=4",
                                               "beam.beam3.segments=4", "beam.beam4.segments=4"}));
  for (const Method method : {Method::kProjected, Method::kPartitioned}) {
    SimulateOptions options;
    options.method = method;
    options.duration = 2.0;
    options.rtol = 1e-2;
    const SimulateReport report = Simulate(model, options, nullptr);
    EXPECT_TRUE(report.Usable()) << report.message;
    EXPECT_LT(report.energy_residual, 0.01 * report.energy_moved) << MethodName(method);
    EXPECT_GT(report.energy_moved, 5.0);
  }
}

}  // namespace
}  // namespace unfurl::sim::judged_test
