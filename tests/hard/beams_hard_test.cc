// Hard cases of beams: extreme sizes and stiffnesses, buckling, many of them. Truth: rigid motion,
// creep and statics in closed form, conservation.
#include "tests/hard/hard_case.h"

namespace unfurl::sim::beams_hard_test {
namespace {

using enum Grade;

std::string Beam(const std::string& name, double length, double mass, double EI, int segments,
                 const std::string& more = {}) {
  return fmt::format("[beam.{}]\nlength = {:.17g}\nmass = {:.17g}\nEI = {:.17g}\n", name, length,
                     mass, EI) +
         (segments > 0 ? fmt::format("segments = {}\n", segments)
                       : fmt::format("model = \"kirchhoff\"\norder = {}\n", -segments)) +
         more;
}
std::string Mark(const std::string& name, const std::string& on, double at) {
  return fmt::format("[mark.{}]\non = \"{}\"\nat = {}\n", name, on, at);
}

// Free and straight it turns at `omega` and goes on at `v`, whatever it is made of: the centrifugal
// force stretches an elastic one by m omega^2 L / 12 EA of its length at each side of the middle.
HardCase Flight(const char* name, Grade grade, double length, double mass, double EI, int segments,
                double omega, double v, double end, double rtol, double EA = 0.0,
                Method method = Method::kAuto) {
  const std::string axial =
      EA > 0.0 ? fmt::format("axial = \"elastic\"\nEA = {:e}\n", EA) : std::string();
  // The pose and the velocity are the start's, at the origin; the centre goes straight on.
  return {name,
          grade,
          Scene(end, Beam("rod", length, mass, EI, segments,
                          axial + fmt::format("velocity = [{:.17g}, 0.0, {:.17g}]\n", v, omega)) +
                         Mark("tip", "rod", 1.0)),
          [=](const Outcome& run) {
            const double half = 0.5 * length, angle = omega * end;
            const double x = half + v * end + half * std::cos(angle);
            const double y = half * omega * end + half * std::sin(angle);
            const double stretch =
                EA > 0.0 ? mass * omega * omega * length * length / (6.0 * EA) : 0.0;
            const double size = length + std::fabs(v) * end;
            const double near = 100.0 * rtol * size + 2.0 * stretch;
            EXPECT_NEAR(run.End("tip.x"), x, near);
            EXPECT_NEAR(run.End("tip.y"), y, near);
          },
          {},
          method,
          rtol};
}

std::vector<HardCase> Flights() {
  return {
      Flight("BeamOfOneSegment", kEasy, 1.0, 1.0, 10.0, 1, 2.0, 1.0, 1.0, 1e-8),
      Flight("BeamOfAMicrometre", kEasy, 1e-6, 1e-15, 1e-20, 4, 2.0, 1e-6, 1.0, 1e-7),
      Flight("BeamOfAKilometre", kMedium, 1e3, 1e5, 1e10, 4, 0.01, 10.0, 10.0, 1e-7),
      Flight("BeamAsHardAsDiamond", kMedium, 1.0, 1.0, 1e9, 4, 2.0, 1.0, 1.0, 1e-5),
      Flight("SmoothBeamAsHardAsDiamond", kMedium, 1.0, 1.0, 1e9, -3, 2.0, 1.0, 1.0, 1e-5),
      Flight("SmoothBeamOfOrderEleven", kMedium, 1.0, 1.0, 10.0, -11, 2.0, 1.0, 0.3, 1e-6),
      Flight("BeamThatTurnsAHundredTimes", kHard, 1.0, 1.0, 1e6, 2, 628.3, 0.0, 1.0, 1e-9),
      Flight("StretchingBeamOfTera", kHard, 1.0, 1.0, 10.0, 4, 2.0, 1.0, 1.0, 1e-5, 1e12),
      Flight("StretchingBeamOfTeraImplicit", kHard, 1.0, 1.0, 10.0, 4, 2.0, 1.0, 1.0, 1e-7, 1e12,
             Method::kImplicit),
      Flight("StretchingSmoothBeamOfTera", kHard, 1.0, 1.0, 10.0, -3, 2.0, 1.0, 1.0, 1e-5, 1e12),
      Flight("StretchingSmoothBeamOfTeraImplicit", kHard, 1.0, 1.0, 10.0, -3, 2.0, 1.0, 1.0, 1e-7,
             1e12, Method::kImplicit),
      Flight("StretchingBeamOfGigaFast", kHard, 1.0, 1.0, 1e3, 4, 30.0, 1.0, 1.0, 1e-6, 1e9,
             Method::kImplicit),
  };
}

std::vector<HardCase> Loads() {
  std::string hanging = Weight();
  for (int k = 0; k < 100; ++k) {
    hanging += Beam(fmt::format("b{}", k), 0.1, 0.01, 1e3, 1);
    hanging += fmt::format("[joint.j{0}]\ninner = \"{1}\"\nouter = \"b{0}.start\"\n{2}", k,
                           k == 0 ? "ground" : fmt::format("b{}.end", k - 1),
                           k == 0 ? "theta = -1.5707963267948966\n" : "");
  }
  hanging += "[mark.tip]\non = \"b99.end\"\n";
  const std::string clamp = "[weld.root]\ninner = \"ground\"\nouter = \"rod.start\"\n";
  const std::string tip = "[mark.tip]\non = \"rod.end\"\n";
  const auto push = [](double x, double y) {
    return fmt::format("[force.f]\non = \"rod.end\"\nforce = [{:.17g}, {:.17g}]\n", x, y);
  };
  const double euler = M_PI * M_PI / 4.0 * 10.0;  // of the cantilever, EI = 10, L = 1 [N]
  return {
      // Straight down it hangs in equilibrium.
      {"AHundredBeamsHang",
       kHard,
       Scene(0.2, hanging),
       [](const Outcome& run) {
         EXPECT_NEAR(run.End("tip.y"), -10.0, 1e-6);
         EXPECT_NEAR(run.End("tip.x"), 0.0, 1e-6);
       },
       {},
       Method::kAuto,
       1e-6},
      // Kelvin and Voigt's material far slower than its vibrations: P L^3 / (3 EI) (1 -
      // e^(-t/beta)).
      {"BeamOfHoney",
       kMedium,
       Scene(1.0,
             Beam("rod", 1.0, 1e-6, 10.0, 16, "damping = 10.0\n") + clamp + push(0.0, 0.1) + tip),
       // n^-2 of the mesh: some 0.4% of the deflection.
       Ends("tip.y", 0.1 / 30.0 * (1.0 - std::exp(-0.1)), 0.01 * 0.1 / 30.0 * 0.1),
       {},
       Method::kAuto,
       1e-7},
      {"HoneyInSmoothBeams",
       kMedium,
       Scene(1.0,
             Beam("rod", 1.0, 1e-6, 10.0, -3, "damping = 10.0\n") + clamp + push(0.0, 0.1) + tip),
       Ends("tip.y", 0.1 / 30.0 * (1.0 - std::exp(-0.1)), 0.01 * 0.1 / 30.0 * 0.1),
       {},
       Method::kAuto,
       1e-7,
       true},
      // Exactly straight and pressed along its axis, nothing pushes it aside; what it bears is
      // said.
      {"PressedBeyondEuler",
       kMedium,
       Scene(1.0, Beam("rod", 1.0, 1.0, 10.0, 16) + clamp + push(-8.0 * euler, 0.0) + tip),
       [](const Outcome& run) {
         EXPECT_NEAR(run.End("tip.y"), 0.0, 1e-3);
         ASSERT_EQ(run.report.warnings.size(), 1u);
         EXPECT_NE(run.report.warnings[0].find("Euler"), std::string::npos);
       },
       {},
       Method::kAuto,
       1e-7},
      // A little aside it buckles, and keeps the energy of the load's potential.
      {"BucklesWithASidePush",
       kHard,
       Scene(0.5, Beam("rod", 1.0, 1.0, 10.0, 16) + clamp + push(-2.0 * euler, 0.1) + tip),
       [](const Outcome& run) {
         EXPECT_GT(run.Largest("tip.y"), 0.1);
         EXPECT_LT(run.residual, 1e-4 * run.energy_scale);
       },
       {},
       Method::kAuto,
       1e-7},
      {"PulledApart",
       kMedium,
       Scene(1.0, Beam("rod", 1.0, 1.0, 0.01, 4) + clamp + push(1e4, 0.0) + tip),
       {},
       "rod"},
      {"FeatherOnARock",
       kEasy,
       Scene(1.0, Body("rock", 1e6, 1e6, "velocity = [1.0, 0.0, 0.5]\n") +
                      Beam("rod", 1.0, 1e-6, 1e-3, 4) +
                      "[weld.w]\ninner = \"rock\"\nouter = \"rod.start\"\n"),
       [](const Outcome& run) {
         EXPECT_NEAR(run.End("rock.x"), 1.0, 1e-7);
         EXPECT_NEAR(run.End("rock.theta"), 0.5, 1e-7);
       },
       {},
       Method::kAuto,
       1e-7},
      {"TwoMarksAtOnePoint",
       kEasy,
       Scene(0.5, Beam("rod", 1.0, 1.0, 10.0, 5) +
                      "[joint.p]\ninner = \"ground\"\nouter = \"rod.start\"\n" + Weight() + tip +
                      Mark("end", "rod", 1.0)),
       [](const Outcome& run) {
         EXPECT_NEAR(run.End("tip.x"), run.End("end.x"), 1e-12);
         EXPECT_NEAR(run.End("tip.y"), run.End("end.y"), 1e-12);
         EXPECT_LT(run.residual, 1e-5 * run.energy_scale);
       },
       {},
       Method::kAuto,
       1e-7},
      {"BeamWithoutLength", kEasy, Scene(1.0, Beam("rod", 0.0, 1.0, 10.0, 4)), {}, "length"},
      {"BeamThatWeighsLessThanNothing",
       kEasy,
       Scene(1.0, Beam("rod", 1.0, -1.0, 10.0, 4)),
       {},
       "mass"},
      {"BeamThatBendsOfItself", kEasy, Scene(1.0, Beam("rod", 1.0, 1.0, -10.0, 4)), {}, "EI"},
  };
}

INSTANTIATE_TEST_SUITE_P(Flights, HardCases, testing::ValuesIn(Flights()));
INSTANTIATE_TEST_SUITE_P(Loads, HardCases, testing::ValuesIn(Loads()));

}  // namespace
}  // namespace unfurl::sim::beams_hard_test
