// Hard cases of functions of time and of contact. Truth: impulses and works in closed form, the
// restitution of the contact's law, conservation.
#include "tests/hard/hard_case.h"

namespace unfurl::sim::events_hard_test {
namespace {

using enum Grade;

constexpr double kInertia = 0.5;  // of the wheel [kg m^2]

HardCase Wheel(const char* name, Grade grade, double duration, const std::string& effect,
               std::function<void(const Outcome&)> rule) {
  return {name, grade,
          Scene(duration,
                Body("wheel", 1.0, kInertia) + Pin("axle", "ground", 0.0, "wheel", 0.0) + effect),
          std::move(rule)};
}
HardCase Refused(const char* name, double duration, const std::string& effect,
                 const std::string& what) {
  HardCase c = Wheel(name, kEasy, duration, effect, nullptr);
  c.refused = what;
  return c;
}
std::string Motor(const std::string& moment) {
  return fmt::format("[joint.axle.motor]\nmoment = {}\n", moment);
}
// A moment that swings many times in the longest step: theta = t / (omega I) at whole periods.
HardCase Swings(const char* name, double frequency, double rtol) {
  HardCase c = Wheel(name, kHard, 0.1, Motor(fmt::format("\"sin(2 * pi * {} * t)\"", frequency)),
                     Ends("axle.theta", 0.1 / (2.0 * M_PI * frequency) / kInertia, 10.0 * rtol));
  c.rtol = rtol;
  return c;
}
std::string Drive(const std::string& what) { return fmt::format("[joint.axle.drive]\n{}\n", what); }

std::vector<HardCase> TimeFunctions() {
  const auto turns = [](double omega) { return Ends("axle.theta_rate", omega, 1e-8 * omega); };
  std::string times = "0.0", values = "0.0";
  constexpr int kTeeth = 100;  // triangles of 1 ms and 1 N m: half a mN m s each
  for (int k = 0; k < kTeeth; ++k) {
    const double t = 0.005 + 0.009 * k;
    times += fmt::format(", {:.4f}, {:.4f}, {:.4f}", t, t + 0.0005, t + 0.001);
    values += ", 0.0, 1.0, 0.0";
  }
  return {
      Wheel("PulseOfANanosecond", kMedium, 1.0,
            Motor("\"1e9 * (step(t - 0.5) - step(t - 0.5 - 1e-9))\""),
            // Of the times 0.5 and 0.5 + 1e-9 a double holds 1e-16 of 1e-9.
            Ends("axle.theta_rate", 1.0 / kInertia, 1e-6)),
      Wheel("PulseOfANanosecondByTable", kMedium, 1.0,
            Motor("{t = [0.0, 0.25, 0.2500000005, 0.250000001], value = [0.0, 0.0, 2e9, 0.0], "
                  "interpolation = \"linear\"}"),
            Ends("axle.theta_rate", 1.0 / kInertia, 1e-6)),
      Wheel("PulseAtTheStart", kEasy, 1.0, Motor("\"1e6 * (1 - step(t - 1e-6))\""),
            turns(1.0 / kInertia)),
      Wheel("PulseThatEndsWithTheRun", kEasy, 1.0, Motor("\"1e3 * step(t - 0.999)\""),
            turns(1.0 / kInertia)),
      Wheel("AHundredTeeth", kMedium, 1.0,
            Motor("{t = [" + times + "], value = [" + values + "], interpolation = \"linear\"}"),
            Ends("axle.theta_rate", kTeeth * 0.0005 / kInertia, 1e-8)),
      Swings("MotorOfTenKilohertz", 1e4, 1e-8),
      Swings("MotorOfTenKilohertzLoosely", 1e4, 1e-3),
      // Periods and steps are commensurate: the longest step is two periods, a period and a half.
      Swings("MotorOfTwoPeriodsAStep", 1e4, 1e-5),
      Swings("MotorOfAPeriodAndAHalfAStep", 7500.0, 1e-5),
      Refused("MotorOfATerahertz", 1.0, Motor("\"sin(1e12 * t)\""), "swings so fast"),
      // The impulse of a bell that no stage of a longest step need meet.
      Wheel("BellOfAMillisecond", kMedium, 1.0, Motor("\"exp(-((t - 0.4321) / 0.0005)^2)\""),
            Ends("axle.theta_rate", 0.0005 * std::sqrt(M_PI) / kInertia, 1e-8)),
      Wheel("MotorAndItsOppositeCancel", kEasy, 1.0, Motor("\"1e9 - 1e9 + 0 * t\""),
            Ends("axle.theta", 0.0, 1e-12)),
      Wheel("DriveStartsInAMicrosecond", kMedium, 1.0,
            Drive("position = \"0.5 * smoothstep((t - 0.3) / 1e-6)\""),
            [](const Outcome& run) {
              EXPECT_NEAR(run.End("axle.theta"), 0.5, 1e-8);
              EXPECT_NEAR(run.End("axle.theta_rate"), 0.0, 1e-8);
              // Of what moved halfway, at 15/8 of the mean rate.
              const double fastest = 15.0 / 8.0 * 0.5 / 1e-6;
              EXPECT_LT(run.residual, 1e-7 * 0.5 * kInertia * fastest * fastest);
            }),
      Wheel("DriveWhoseRateJumps", kMedium, 1.0, Drive("rate = \"3 * step(t - 0.4)\""),
            [](const Outcome& run) {
              EXPECT_NEAR(run.End("axle.theta"), 3.0 * 0.6, 1e-7);
              EXPECT_LT(run.residual, 1e-7 * run.energy_scale);
            }),
      Wheel("DriveOfATurnAMicrosecond", kEasy, 1e-3, Drive("rate = 6283185.307179586"),
            Ends("axle.theta", 2000.0 * M_PI, 1e-4)),
      Refused("DriveThatJumps", 1.0, Drive("position = \"step(t - 0.5)\""), "axle"),
      Refused("MotorThroughAPole", 1.0, Motor("\"1 / (t - 0.5)\""), "0.5"),
      Refused("MotorOfARootOfLess", 1.0, Motor("\"sqrt(0.5 - t)\""), "sqrt"),
      Refused("MotorOfNothing", 1.0, Motor("\"nan\""), "nan"),
      Refused("MotorThatOverflows", 1.0, Motor("\"exp(1000 * t)\""), "exp"),
  };
}

constexpr char kHunt[] = "law = \"hunt_crossley\"\nalpha = 0.3\n";  // [s/m]

// A bar with its stops, towards which it turns at `rate`.
std::string Latch(const std::string& name, double theta, double rate, double K,
                  const std::string& law, double clearance) {
  return Body(name, 1.0, 0.02) +
         Pin("j" + name, "ground", 0.0, name, 0.0,
             fmt::format("theta = {:.17g}\ntheta_rate = {:.17g}\n"
                         "[joint.j{}.latch]\ntheta_a = {:.17g}\ntheta_b = {:.17g}\nlever = 0.02\n"
                         "contact = \"{}\"\n",
                         theta, rate, name, clearance, clearance, "c" + name)) +
         fmt::format("[contact.c{}]\nK = {:e}\n{}", name, K, law);
}

// Of Hunt and Crossley's law: what v in gives out, a v (1 + e) = ln((1 + a v) / (1 - a e v)) with
// a = 1.5 alpha, whatever mass and stiffness are.
double Restitution(double alpha, double v) {
  const double a = 1.5 * alpha;
  double low = 0.0, high = 1.0 - 1e-15;
  if (a * v > 1.0) high = std::min(high, 1.0 / (a * v) * (1.0 - 1e-15));
  for (int k = 0; k < 200; ++k) {
    const double e = 0.5 * (low + high);
    (a * v * (1.0 + e) > std::log((1.0 + a * v) / (1.0 - a * e * v)) ? low : high) = e;
  }
  return low;
}

// One impact on the lower stop.
HardCase Impact(const char* name, Grade grade, double rate, double K, double rtol = 1e-9) {
  constexpr double kClearance = 0.01, kLever = 0.02;
  // The run ends on the way back; it takes the clearance and the time of a Hertz contact.
  const double mass = 0.02 / (kLever * kLever), v = rate * kLever;
  const double contact = 2.94 * std::pow(1.25 * mass * v * v / K, 0.4) / v;
  return {name,
          grade,
          Scene(10.0 * (kClearance / rate + contact) / Restitution(0.3, v),
                Latch("bar", 0.0, -rate, K, kHunt, kClearance) +
                    fmt::format("[event.back]\nwhen = \"jbar.theta\"\nlevel = {}\n"
                                "direction = \"rising\"\nstop = true\n",
                                -0.9 * kClearance)),
          [=](const Outcome& run) {
            EXPECT_EQ(run.report.Count(EventKind::kContactStart), 1);
            const double e = Restitution(0.3, rate * kLever);
            EXPECT_EQ(run.report.stopped_by, "back");
            for (const Event& event : run.report.events) {
              if (event.kind != EventKind::kContactEnd) continue;
              EXPECT_NEAR(event.restitution, e, 1e-5);
            }
          },
          {},
          Method::kAuto,
          rtol};
}

std::vector<HardCase> Contacts() {
  return {
      Impact("ImpactOfAMetreASecond", kEasy, 50.0, 5e9),
      Impact("ImpactOfASnail", kMedium, 0.05, 5e9),
      Impact("ImpactOfABullet", kHard, 2e4, 5e12),
      Impact("ImpactOnAStopOfDiamond", kHard, 50.0, 1e13),
      Impact("ImpactOnAStopOfRubber", kMedium, 1.0, 5e6),
      // Three alike latch at one instant, theta_a being passed at constant rate.
      {"ThreeLatchesAtOneInstant", kMedium,
       Scene(0.6, Latch("a", 1.0, -2.0, 5e8, kHunt, 0.01) +
                      Latch("b", 1.0, -2.0, 5e8, kHunt, 0.01) +
                      Latch("c", 1.0, -2.0, 5e8, kHunt, 0.01)),
       [](const Outcome& run) {
         int latched = 0;
         for (const Event& event : run.report.events) {
           if (event.kind != EventKind::kLatch) continue;
           ++latched;
           EXPECT_NEAR(event.t, (1.0 - 0.01) / 2.0, 1e-9);
         }
         EXPECT_EQ(latched, 3);
         EXPECT_NEAR(run.End("ja.theta"), run.End("jc.theta"), 1e-7);
       }},
      // Already between its stops it is closed from the start, and bounces between them.
      {"LatchedFromTheStart", kEasy, Scene(0.5, Latch("bar", 0.004, 0.5, 5e8, kHunt, 0.01)),
       [](const Outcome& run) {
         // 50 kg at x_p go 5e-5 m in at 0.01 m/s, with K of 5e8.
         EXPECT_LT(run.Largest("jbar.theta"), 0.01 + 5e-5 / 0.02);
         EXPECT_GE(run.report.Count(EventKind::kContactStart), 5);
         EXPECT_LT(run.residual, 1e-4 * run.energy_scale);
       }},
      {"NoClearanceAtAll", kHard, Scene(0.2, Latch("bar", 1e-3, -1.0, 5e8, kHunt, 0.0)),
       [](const Outcome& run) {
         EXPECT_LT(run.residual, 1e-4 * run.energy_scale);
         EXPECT_LT(std::fabs(run.End("jbar.theta_rate")), 1.0);
       }},
      // A ball in a bowl, by a spring: bounces follow one another ever faster, without end.
      {"ChatterAgainstASpring",
       kHard,
       Scene(2.0, Latch("bar", 0.05, 0.0, 5e8, "law = \"hunt_crossley\"\nalpha = 3.0\n", 0.01) +
                      "[joint.jbar.spring]\nstiffness = 1.0\npreload = 1.0\n"),
       [](const Outcome& run) {
         // It rests where K (x_p depth)^1.5 x_p = k (theta + preload).
         const double depth = std::pow(0.99 / (5e8 * 0.02), 2.0 / 3.0) / 0.02;
         EXPECT_NEAR(run.End("jbar.theta"), -0.01 - depth, 0.1 * depth);
         EXPECT_GT(run.report.Count(EventKind::kContactStart), 5);
       },
       {},
       Method::kAuto,
       1e-6},
      {"StartsInsideItsStop",
       kEasy,
       Scene(1.0, Latch("bar", -0.5, 0.0, 5e8, kHunt, 0.01) +
                      "[joint.jbar.spring]\nstiffness = 1.0\npreload = 1.0\n"),
       {},
       "jbar"},
      {"StopsThatCross", kEasy, Scene(1.0, Latch("bar", 0.5, 0.0, 5e8, kHunt, -0.01)), {}, "theta"},
  };
}

INSTANTIATE_TEST_SUITE_P(TimeFunctions, HardCases, testing::ValuesIn(TimeFunctions()));
INSTANTIATE_TEST_SUITE_P(Contacts, HardCases, testing::ValuesIn(Contacts()));

}  // namespace
}  // namespace unfurl::sim::events_hard_test
