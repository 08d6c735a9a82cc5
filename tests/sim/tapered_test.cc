// Beams whose section changes along them, of both models, against published frequencies,
// quadratures of beam theory, rigid bodies and one another.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "runs.h"
#include "scenes.h"
#include "sim/implicit/equilibrium.h"
#include "sim/implicit/modes.h"

namespace unfurl::sim::tapered_test {
namespace {

// 2 m, 3 kg and 40 N m^2 at the start.
constexpr double kLength = 2.0, kMass = 3.0, kStiffness = 40.0;

std::string TaperedBeam(const std::string& mesh, double taper, const std::string& of,
                        const std::string& more = {}, double duration = 1.0) {
  return fmt::format(
             "[scene]\nname = \"tapered\"\nduration = {}\n[beam.rod]\nlength = {}\nmass = {}\n"
             "EI = {}\ntaper = {}\ntaper_of = \"{}\"\n{}\n",
             duration, kLength, kMass, kStiffness, taper, of, mesh) +
         more;
}

std::string Smooth(int order) { return fmt::format("model = \"kirchhoff\"\norder = {}", order); }
std::string Segments(int n) { return fmt::format("segments = {}", n); }

constexpr char kClampedStart[] = "[weld.root]\ninner = \"ground\"\nouter = \"rod.start\"\n";
constexpr char kClampedEnd[] = "[weld.root]\ninner = \"ground\"\nouter = \"rod.end\"\n";

// omega in units of sqrt(EI / (rho A L^4)), both of the start.
std::vector<double> Wavelike(const std::string& toml, double volume, int count) {
  const Model model = ModelFrom(toml);
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state;
  const ModesReport report = FindModes(&dynamics, y.data(), count);
  const double unit = std::sqrt(kStiffness * volume / (kMass * std::pow(kLength, 3)));
  std::vector<double> out;
  for (const auto& mode : report.modes) out.push_back(2.0 * M_PI * mode.frequency / unit);
  return out;
}

struct Cantilever {
  const char* of;
  double taper, volume;
  double omega[3];  // clamped at the start
};
// At 1/2: Downs, Transverse vibrations of cantilever beams having unequal breadth and depth tapers,
// J. Applied Mechanics 44 (1977); all: Rayleigh-Ritz with 14 polynomials, to the digits given.
constexpr Cantilever kCantilevers[] = {
    {"height", 0.5, 0.75, {3.8237848, 18.3172609, 47.2648270}},
    {"both", 0.5, 7.0 / 12.0, {4.6251502, 19.5476132, 48.5788993}},
    {"width", 0.5, 0.75, {4.3151703, 23.5192566, 63.1991964}},
    {"height", 0.2, 0.6, {4.2924945, 15.7427003, 36.8845557}},
    {"both", 0.2, 0.41333333333333, {6.1963910, 18.3854681, 39.8336413}}};

TEST(Tapered, FrequenciesOfSmoothCantilevers) {
  // Of orders 2, 4 and 6, by mode; references have nine digits.
  constexpr double kLeft[3][3] = {{1e-6, 5e-5, 1e-3}, {3e-8, 1e-6, 1e-5}, {3e-8, 3e-8, 1e-6}};
  for (const Cantilever& c : kCantilevers) {
    for (int step = 0; step < 3; ++step) {
      const auto omega =
          Wavelike(TaperedBeam(Smooth(2 + 2 * step), c.taper, c.of, kClampedStart), c.volume, 3);
      ASSERT_GE(omega.size(), 3U);
      for (int k = 0; k < 3; ++k) {
        EXPECT_NEAR(omega[k], c.omega[k], kLeft[step][k] * c.omega[k])
            << c.of << " " << c.taper << " order " << 2 + 2 * step << " mode " << k + 1;
      }
    }
  }
}

TEST(Tapered, FrequenciesOfSegmentedCantilevers) {
  for (const Cantilever& c : kCantilevers) {
    double last[3] = {};
    for (const int n : {16, 32}) {
      const auto omega =
          Wavelike(TaperedBeam(Segments(n), c.taper, c.of, kClampedStart), c.volume, 3);
      ASSERT_GE(omega.size(), 3U);
      for (int k = 0; k < 3; ++k) {
        const double error = omega[k] / c.omega[k] - 1.0;
        if (n == 32) {
          EXPECT_GT(std::log2(last[k] / error), 1.8) << c.of << " " << c.taper << " " << k;
        }
        last[k] = error;
      }
    }
  }
}

// The other way round: what was the start is the end, of both models.
TEST(Tapered, MirroredBeamsAreTheSame) {
  for (const Cantilever& c : kCantilevers) {
    // Stiffness and section at what is now the start.
    const double size = c.taper;
    const std::string of = c.of;
    const double bending = of == "width"    ? size
                           : of == "height" ? std::pow(size, 3)
                                            : std::pow(size, 4);
    const auto turned = [&](const std::string& mesh) {
      std::string toml = TaperedBeam(mesh, 1.0 / c.taper, c.of, kClampedEnd);
      const std::string from = fmt::format("EI = {}\n", kStiffness);
      toml.replace(toml.find(from), from.size(),
                   fmt::format("EI = {:.17g}\n", kStiffness * bending));
      return toml;
    };
    for (const std::string& mesh : {Smooth(4), Segments(12)}) {
      const auto a = Wavelike(TaperedBeam(mesh, c.taper, c.of, kClampedStart), c.volume, 3);
      const auto b = Wavelike(turned(mesh), c.volume, 3);
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(b[k], a[k], 1e-8 * a[k]) << mesh << c.of << k;
    }
  }
}

// A small load at the tip: P L^3 / EI int (1 - x)^2 / (EI over EI_0) dx. Of half the size:
// height 0.5451774, both 2/3, width 0.3862944.
TEST(Tapered, TipOfALoadedCantilever) {
  const double load = 1e-4;  // [N]; slopes of some 1e-5
  const struct {
    const char* of;
    double integral;
  } kCases[] = {{"height", 0.5451774444795627}, {"both", 2.0 / 3.0}, {"width", 0.3862943611198899}};
  for (const auto& c : kCases) {
    const double exact = load * std::pow(kLength, 3) / kStiffness * c.integral;
    double coarse = 0.0;
    for (const std::string& mesh : {Smooth(2), Segments(20), Segments(40)}) {
      const Model model = ModelFrom(
          TaperedBeam(mesh, 0.5, c.of,
                      kClampedStart + fmt::format("[force.f]\non = \"rod.end\"\nforce = [0.0, {}]\n"
                                                  "[mark.tip]\non = \"rod.end\"\n",
                                                  load)));
      Dynamics dynamics(model);
      std::vector<double> y = model.initial_state;
      EXPECT_TRUE(FindEquilibrium(&dynamics, y.data()).found);
      dynamics.Update(0.0, y.data());
      const double error = MotionOf(model, model.marks[0].point, y.data()).y / exact - 1.0;
      if (mesh.starts_with("model")) {
        EXPECT_LT(std::fabs(error), 1e-7);
      } else if (coarse == 0.0) {
        coarse = error;
      } else {
        EXPECT_NEAR(coarse / error, 4.0, 0.3) << c.of;
        EXPECT_LT(std::fabs(error), 3e-3);
      }
    }
  }
}

// Stiff, on a pin, in gravity: a rigid pendulum of m, its centre at x_c and J about the pin, by
// int x A and int x^2 A; theta'' = -m g x_c sin(theta) / J, whose first integral is the energy.
TEST(Tapered, PendulumHasTheBeamsMoments) {
  // both, 1/2: A = (1 - x/2)^2: int x A / int A = 11/28, int x^2 A / int A = 8/35.
  const double arm = 11.0 / 28.0 * kLength, J = 8.0 / 35.0 * kMass * kLength * kLength;
  for (const std::string& mesh : {Smooth(1), Segments(24)}) {
    std::string toml = TaperedBeam(mesh, 0.5, "both",
                                   "[joint.pin]\ninner = \"ground\"\nouter = \"rod.start\"\n"
                                   "theta = 0.0\n[gravity]\nacceleration = [0.0, -9.81]\n"
                                   "[mark.tip]\non = \"rod.end\"\n",
                                   0.5);
    toml.replace(toml.find("EI = 40"), 7, "EI = 4e6");
    SimulateOptions options;
    options.rtol = 1e-6;
    options.method = Method::kImplicit;
    const MarkTracks tracks = SimulateMarks(data::ParseScene(toml, "test.toml"), options);
    ASSERT_TRUE(tracks.report.Usable()) << tracks.report.message;
    const double drop = -tracks.y[0].back() / kLength;  // sine of the angle
    const double speed = std::hypot(tracks.vx[0].back(), tracks.vy[0].back()) / kLength;
    const double exact = std::sqrt(2.0 * kMass * 9.81 * arm * drop / J);
    // It rings by some 1e-5 of its length, at some 100 rad/s times; 24 segments have their masses
    // at their middles, (1/24)^2 of it.
    EXPECT_NEAR(speed, exact, (mesh.starts_with("model") ? 1e-4 : 2e-3) * exact) << mesh;
    EXPECT_GT(drop, 0.3);
  }
}

// Two formulations without a common equation of the beam: a tapered flail, damped a little.
TEST(Tapered, SegmentsComeToTheSmoothBeam) {
  const auto tracks = [&](const std::string& mesh) {
    SimulateOptions options;
    options.rtol = 1e-7;
    return SimulateMarks(
        data::ParseScene(TaperedBeam(mesh + "\ndamping = 1e-3", 0.4, "both",
                                     "[joint.pin]\ninner = \"ground\"\nouter = \"rod.start\"\n"
                                     "[joint.pin.motor]\nmoment = \"20 * sin(4 * t)\"\n"
                                     "[gravity]\nacceleration = [0.0, -9.81]\n"
                                     "[mark.tip]\non = \"rod.end\"\n[mark.half]\non = \"rod\"\n"
                                     "at = 0.5\n"),
                         "test.toml"),
        options);
  };
  const MarkTracks smooth = tracks(Smooth(4)), finer = tracks(Smooth(6));
  const MarkTracks coarse = tracks(Segments(12)), fine = tracks(Segments(24));
  const double a = FarthestApart(smooth, coarse), b = FarthestApart(smooth, fine);
  std::printf("found: flail, order 4 to 6 %.2e m, 12 segments %.2e, 24 %.2e\n",
              FarthestApart(smooth, finer), a, b);
  EXPECT_LT(FarthestApart(smooth, finer), 3e-4);  // of 2 m
  EXPECT_GT(a / b, 3.5);
  EXPECT_LT(b, 0.01);
}

// On strings every point is pulled back alike.
TEST(Tapered, StringsAddTheSameToEveryMode) {
  const double unit = std::sqrt(kStiffness * (7.0 / 12.0) / (kMass * std::pow(kLength, 3)));
  const auto free = Wavelike(TaperedBeam(Smooth(4), 0.5, "both"), 7.0 / 12.0, 3);
  const auto hung =
      Wavelike(TaperedBeam(Smooth(4), 0.5, "both", "[suspension]\nlength = 2.0\n"), 7.0 / 12.0, 6);
  ASSERT_EQ(hung.size(), 6U);
  const double sigma = 9.81 / 2.0 / (unit * unit);
  for (std::size_t k = 0; k < 6; ++k) {
    const double exact = std::sqrt((k < 3 ? 0.0 : free[k - 3] * free[k - 3]) + sigma);
    EXPECT_NEAR(hung[k], exact, 1e-9 * exact) << k;
  }
}

// A stretching bar, pulled at its thin end: F L / EA int dx / A. Of half the width: 2 log 2.
TEST(Tapered, StretchingBarInTension) {
  const double EA = 1e5, load = 10.0;
  const double exact = load * kLength / EA * 2.0 * std::log(2.0);
  for (const int n : {8, 16}) {
    const Model model = ModelFrom(
        TaperedBeam(Segments(n) + fmt::format("\naxial = \"elastic\"\nEA = {}", EA), 0.5, "width",
                    kClampedStart + fmt::format("[force.f]\non = \"rod.end\"\nforce = [{}, 0.0]\n"
                                                "[mark.tip]\non = \"rod.end\"\n",
                                                load)));
    Dynamics dynamics(model);
    std::vector<double> y = model.initial_state;
    EXPECT_TRUE(FindEquilibrium(&dynamics, y.data()).found);
    dynamics.Update(0.0, y.data());
    const double stretch = MotionOf(model, model.marks[0].point, y.data()).x - kLength;
    // Without the last half segment, which is rigid at a free end.
    const double last = std::log((1.0 - 0.5 * (1.0 - 0.5 / n)) / 0.5) * 2.0 * load * kLength / EA;
    EXPECT_NEAR(stretch, exact - last, 5e-2 / (n * n) * exact) << n;
  }
}

TEST(Tapered, WhatDoesNotFitIsRefused) {
  const auto refused = [](const std::string& toml) {
    try {
      ModelFrom(toml);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_THAT(refused(TaperedBeam("", 0.01, "both")), ::testing::HasSubstr("0.05 to 20"));
  EXPECT_THAT(refused(TaperedBeam("", 0.5, "depth")), ::testing::HasSubstr("taper_of"));
  EXPECT_THAT(refused(TaperedBeam(Smooth(2), 0.5, "both",
                                  "[force.f]\non = \"rod\"\nper_length = [0.0, 1.0]\n")),
              ::testing::HasSubstr("tapered smooth beam 'rod'"));
}

}  // namespace
}  // namespace unfurl::sim::tapered_test
