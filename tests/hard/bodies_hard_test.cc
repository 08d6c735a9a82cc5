// Hard cases of rigid bodies: sizes and units, stiffness, degenerate joints and loops, chaos.
// Truth: closed forms, conservation, integration of one equation by other means.
#include "tests/hard/hard_case.h"

namespace unfurl::sim::bodies_hard_test {
namespace {

using enum Grade;

// A pendulum of mass m, radius of gyration r / 2, whose centre is r below the pin.
HardCase Pendulum(const char* name, Grade grade, double m, double r, double g, double swings,
                  double theta, double rtol = 1e-8) {
  const double inertia = 0.25 * m * r * r, square = m * g * r / (inertia + m * r * r);
  const double end = swings * 2.0 * M_PI / std::sqrt(square);
  const auto at =
      Oscillate([=](double, double x, double) { return -square * std::sin(x); }, theta, 0.0, end);
  return {name,
          grade,
          Scene(end, Body("bar", m, inertia) +
                         Pin("pin", "ground", 0.0, "bar", -r,
                             fmt::format("zero_angle = -1.5707963267948966\ntheta = {}\n", theta)) +
                         Weight(g)),
          Ends("pin.theta", at[0], std::max(1e3, 63.0 * swings) * rtol * std::fabs(theta)),
          {},
          Method::kAuto,
          rtol};
}

// A mass on a spring to the ground, along the x axis, out by `a` of its length.
HardCase Bounce(const char* name, Grade grade, double m, double k, double length, double a,
                double angle) {
  const double omega = std::sqrt(k / m);
  return {name, grade,
          Scene(angle / omega,
                Body("ball", m, m * length * length,
                     fmt::format("pose = [{:.17g}, 0.0, 0.0]\n", length * (1.0 + a))) +
                    fmt::format("[spring.s]\na = \"ground\"\nb = \"ball\"\nstiffness = {:.17g}\n"
                                "free_length = {:.17g}\n",
                                k, length)),
          Follows(
              "ball.x", [=](double t) { return length * (1.0 + a * std::cos(omega * t)); },
              1e-5 * a * length)};
}

// A body on a pin through its centre, on which `effect` acts; `angle` is where it ends.
HardCase Wheel(const char* name, Grade grade, double inertia, double rate, double duration,
               const std::string& effect, double angle, double tolerance,
               Method method = Method::kAuto) {
  return {name,
          grade,
          Scene(duration, Body("wheel", 1.0, inertia) +
                              Pin("axle", "ground", 0.0, "wheel", 0.0,
                                  fmt::format("theta_rate = {:.17g}\n", rate)) +
                              effect),
          Ends("axle.theta", angle, tolerance),
          {},
          method};
}

std::vector<HardCase> Sizes() {
  const auto flies = [](const char* name, double mass, double v, double end) {
    return HardCase{
        name, kEasy,
        Scene(end, Body("stone", mass, mass, fmt::format("velocity = [{:.17g}, 0, 1]\n", v))),
        Follows(
            "stone.x", [=](double t) { return v * t; }, 1e-9 * v * end)};
  };
  return {
      Pendulum("PendulumOfAMicrometre", kEasy, 1e-9, 1e-6, 9.81, 2.3, 1.0),
      Pendulum("PendulumOfAKilometre", kEasy, 1e6, 1e3, 9.81, 2.3, 1.0),
      Pendulum("PendulumInMicrogravity", kEasy, 1.0, 1.0, 9.81e-6, 1.3, 0.5),
      Pendulum("PendulumNearlyUpright", kMedium, 1.0, 1.0, 9.81, 1.0, 3.1, 1e-10),
      Pendulum("PendulumAHundredSwings", kMedium, 1.0, 1.0, 9.81, 100.25, 0.3, 1e-10),
      Pendulum("PendulumHardlyMoves", kEasy, 1.0, 1.0, 9.81, 2.3, 1e-5, 1e-10),
      flies("FlightOfAMicrosecond", 1.0, 1.0, 1e-6),
      flies("FlightOfTenDays", 1.0, 1.0, 1e6),
      flies("FlightOfAGrain", 1e-9, 1e3, 1.0),
      flies("FlightAtAMillionMetresPerSecond", 1e6, 1e6, 1.0),
      Bounce("SpringOfAThousandGiga", kEasy, 1e-3, 1e12, 1.0, 1e-2, 20.0),
      Bounce("SpringOfANanonewton", kEasy, 1e3, 1e-9, 1.0, 0.3, 7.0),
      Bounce("SpringHardlyStretched", kEasy, 1.0, 100.0, 1.0, 1e-6, 20.0),
      Bounce("SpringAThousandPeriods", kMedium, 1.0, 1e4, 1.0, 0.1, 6283.0),
  };
}

// Two equal masses on a stiff spring that turn about each other: a rigid dumb-bell but for the
// stretch m omega^2 r / k, and as much again for its vibration.
HardCase Dumbbell(const char* name, Grade grade, double k, Method method, double rtol) {
  constexpr double kMass = 1.0, kRadius = 0.5, kOmega = 1.0, kEnd = 3.0;
  const auto ball = [&](const char* of, double side) {
    return Body(of, kMass, 0.1,
                fmt::format("pose = [{}, 0, 0]\nvelocity = [0, {}, 0]\n", side * kRadius,
                            side * kRadius * kOmega));
  };
  const double stretch = kMass * kOmega * kOmega * kRadius / k;
  return {name,
          grade,
          Scene(kEnd,
                ball("east", 1.0) + ball("west", -1.0) +
                    fmt::format("[spring.rod]\na = \"west\"\nb = \"east\"\nstiffness = {:e}\n", k)),
          [=](const Outcome& run) {
            const double near = 10.0 * rtol + 2.0 * stretch;
            EXPECT_NEAR(run.End("east.x"), kRadius * std::cos(kOmega * kEnd), near);
            EXPECT_NEAR(run.End("east.y"), kRadius * std::sin(kOmega * kEnd), near);
            EXPECT_NEAR(run.End("west.x") + run.End("east.x"), 0.0, 1e-9);
          },
          method == Method::kAuto ? "energy" : "",
          method,
          rtol};
}

std::vector<HardCase> Stiff() {
  const double friction = 1e-3 * std::atanh(0.5);  // creep under half the moment of friction
  return {
      Dumbbell("DumbbellOfMega", kMedium, 1e6, Method::kAuto, 1e-6),
      Dumbbell("DumbbellOfGigaImplicit", kMedium, 1e9, Method::kImplicit, 1e-5),
      Dumbbell("DumbbellOfTeraImplicit", kHard, 1e12, Method::kImplicit, 1e-5),
      Dumbbell("DumbbellOfTera", kHard, 1e12, Method::kAuto, 1e-3),
      Wheel("TorsionSpringOfGiga", kEasy, 1.0, 1.0, 1e-3, "[joint.axle.spring]\nstiffness = 1e9\n",
            std::sin(std::sqrt(1e9) * 1e-3) / std::sqrt(1e9), 1e-10),
      // omega = I / c and falls by e in I / c.
      Wheel("DamperOfGiga", kMedium, 1.0, 1.0, 1.0, "[joint.axle.damper]\ndamping = 1e9\n", 1e-9,
            1e-7),
      Wheel("DamperHardlyThere", kEasy, 1.0, 1.0, 1.0, "[joint.axle.damper]\ndamping = 1e-9\n", 1.0,
            1e-7),
      // theta = I / c ln(1 + c omega t / I).
      Wheel("QuadraticDamperOfMega", kMedium, 1.0, 10.0, 1.0,
            "[joint.axle.quadratic_damper]\ndamping = 1e6\n", 1e-6 * std::log1p(1e7), 1e-7),
      // It creeps as smooth friction does.
      Wheel("FrictionHoldsAMotor", kMedium, 1.0, friction, 10.0,
            "[joint.axle.friction]\nmoment = 10.0\ncreep_rate = 1e-3\n[joint.axle.motor]\n"
            "moment = 5.0\n",
            10.0 * friction, 1e-6),
      // Dry but for the last 1e-6 rad/s: it stops after omega I / M, having turned half of that.
      Wheel("FrictionStopsAWheel", kHard, 1.0, 1.0, 3.0,
            "[joint.axle.friction]\nmoment = 1.0\ncreep_rate = 1e-6\n", 0.5, 1e-5),
      // The same spring by a thousand times its period: energy only.
      {"SpringAndLightBody", kMedium,
       Scene(1.0, Body("speck", 1e-9, 1e-15) + Body("rock", 1e3, 10.0, "velocity = [0, 0, 0.3]\n") +
                      Pin("pin", "rock", 0.5, "speck", -1e-3,
                          "theta = 0.5\n[joint.pin.spring]\n"
                          "stiffness = 1e-9\n")),
       [](const Outcome& run) {
         EXPECT_NEAR(run.End("rock.theta"), 0.3, 1e-7);  // a billionth as heavy, it feels nothing
         EXPECT_LT(run.residual, 1e-6 * run.energy_scale);
       }},
  };
}

// Links of length `l` from the ground, end to end, each `theta` against the one before.
std::string Chain(const std::vector<double>& l, const std::vector<double>& theta,
                  const std::vector<double>& mass) {
  std::string text;
  for (std::size_t k = 0; k < l.size(); ++k) {
    const std::string name = fmt::format("link{}", k);
    text += Body(name, mass[k], mass[k] * l[k] * l[k] / 12.0 + 1e-12);
    text += Pin(fmt::format("j{}", k), k == 0 ? "ground" : fmt::format("link{}", k - 1),
                k == 0 ? 0.0 : 0.5 * l[k - 1], name, -0.5 * l[k],
                fmt::format("theta = {:.17g}\n", theta[k]));
  }
  return text;
}

HardCase KeepsEnergy(const char* name, Grade grade, double end, const std::string& text,
                     double part, double rtol = 1e-9, Method method = Method::kAuto) {
  return {name,
          grade,
          Scene(end, text),
          [=](const Outcome& run) { EXPECT_LT(run.residual, part * run.energy_scale); },
          {},
          method,
          rtol};
}

std::vector<HardCase> Degenerate() {
  const std::string together = Body("a", 1.0, 0.1) + Body("b", 2.0, 0.3);
  const auto swing = [](double square, double x, double end) {
    return Oscillate([=](double, double q, double) { return -square * std::sin(q); }, x, 0.0,
                     end)[0];
  };
  const double down = 1.5707963267948966;
  return {
      // Two pendulums on one pin do not know of each other.
      {"TwoJointsAtOnePoint", kEasy,
       Scene(2.0, together + Pin("p", "ground", 0.0, "a", -0.5, "theta = -0.5\n") +
                      Pin("q", "ground", 0.0, "b", -0.7, "theta = -1.0\n") + Weight()),
       [=](const Outcome& run) {
         const double a = 9.81 * 0.5 / (0.1 + 0.25), b = 2.0 * 9.81 * 0.7 / (0.3 + 2.0 * 0.49);
         EXPECT_NEAR(run.End("p.theta") + down, swing(a, down - 0.5, 2.0), 1e-6);
         EXPECT_NEAR(run.End("q.theta") + down, swing(b, down - 1.0, 2.0), 1e-6);
       }},
      // Pinned at its own centre it turns evenly, whatever the other body does.
      {"JointAtTheCentreOfMass", kEasy,
       Scene(2.0, together + Pin("p", "ground", 0.0, "a", -0.5, "theta = -0.5\n") +
                      Pin("q", "a", 0.5, "b", 0.0, "theta_rate = 3.0\n") + Weight()),
       Ends("b.theta", -0.5 + 6.0, 1e-6)},
      {"LengthOfTheLinkIsNothing", kMedium,
       Scene(2.0, together + Pin("p", "ground", 0.0, "a", 0.0, "theta_rate = 1.0\n") +
                      Pin("q", "a", 0.0, "b", 0.0, "theta_rate = 2.0\n") + Weight()),
       Ends("b.theta", 6.0, 1e-7)},
      KeepsEnergy("LinkOfANanogram", kMedium, 1.0,
                  Chain({1.0, 1.0}, {-0.3, 0.4}, {1.0, 1e-9}) + Weight(), 1e-6),
      KeepsEnergy("LightLinkCarriesAHeavyOne", kMedium, 2.0,
                  Chain({1.0, 1.0}, {-0.3, 0.4}, {1e-6, 1.0}) + Weight(), 1e-6),
      KeepsEnergy("MassesOverFifteenDecades", kHard, 1.0,
                  Chain({1.0, 1.0, 1.0}, {-0.3, 0.4, -0.2}, {1e6, 1.0, 1e-9}) + Weight(), 1e-6),
      KeepsEnergy("LengthsOverSixDecades", kMedium, 0.1,
                  Chain({1e3, 1.0, 1e-3}, {-0.3, 0.4, -0.2}, {1.0, 1.0, 1.0}) + Weight(), 1e-5),
      KeepsEnergy("StretchedChainOfTen", kMedium, 1.0,
                  Chain(std::vector<double>(10, 0.3), std::vector<double>(10, 0.0),
                        std::vector<double>(10, 0.5)) +
                      Weight(),
                  1e-6),
      KeepsEnergy("DoublePendulumInChaos", kMedium, 10.0,
                  Chain({1.0, 1.0}, {1.0, 0.5}, {1.0, 1.0}) + Weight(), 1e-6, 1e-10),
      KeepsEnergy("TriplePendulumInChaos", kHard, 6.0,
                  Chain({1.0, 0.5, 0.3}, {1.5, 0.1, 0.2}, {1.0, 1.0, 1.0}) + Weight(), 1e-6, 1e-10),
      KeepsEnergy("ChaosByPartitioning", kHard, 5.0,
                  Chain({1.0, 1.0}, {1.0, 0.5}, {1.0, 1.0}) + Weight(), 1e-5, 1e-9,
                  Method::kPartitioned),
      KeepsEnergy("ChaosByImplicitSteps", kHard, 3.0,
                  Chain({1.0, 1.0}, {1.0, 0.5}, {1.0, 1.0}) + Weight(), 1e-5, 1e-8,
                  Method::kImplicit),
      // Upright at rest: what rounding starts grows as exp(sqrt(3 g / (2 l)) t), 2e-16 to 1e-11.
      {"UprightAtRestStaysThere", kMedium,
       Scene(3.0, Chain({1.0}, {1.5707963267948966}, {1.0}) + Weight()),
       [](const Outcome& run) { EXPECT_LT(run.Farthest("j0.theta"), 1e-9); }},
      {"TwoPinsThatDoNotMeet",
       kEasy,
       Scene(1.0, Body("bar", 1.0, 0.1) + Pin("left", "ground", 0.0, "bar", 0.0) +
                      Pin("right", "ground", 2.0, "bar", 1.0)),
       {},
       "right"},
      {"LinksTooShortToMeet",
       kEasy,
       Scene(1.0, Chain({1.0, 1.0}, {0.5, -1.0}, {1.0, 1.0}) +
                      Pin("close", "ground", 3.0, "link1", 0.5)),
       {},
       "close"},
      // One of the two is left out and named; it swings as by the other alone.
      {"TheSamePinTwice", kMedium,
       Scene(2.0, Body("bar", 1.0, 0.1) +
                      Pin("once", "ground", 0.0, "bar", -0.5, "theta = -0.5\n") +
                      Pin("again", "ground", 0.0, "bar", -0.5, "theta = -0.5\n") + Weight()),
       [=](const Outcome& run) {
         ASSERT_EQ(run.model.warnings.size(), 1u);
         EXPECT_NE(run.model.warnings[0].find("again"), std::string::npos) << run.model.warnings[0];
         EXPECT_NEAR(run.End("once.theta") + down, swing(9.81 * 0.5 / 0.35, down - 0.5, 2.0), 1e-6);
       }},
  };
}

INSTANTIATE_TEST_SUITE_P(Sizes, HardCases, testing::ValuesIn(Sizes()));
INSTANTIATE_TEST_SUITE_P(Stiff, HardCases, testing::ValuesIn(Stiff()));
INSTANTIATE_TEST_SUITE_P(Degenerate, HardCases, testing::ValuesIn(Degenerate()));

}  // namespace
}  // namespace unfurl::sim::bodies_hard_test
