// Modes of smooth beams against closed forms, and against fine meshes of segments where there is
// none.
#include <gtest/gtest.h>

#include <cmath>

#include "scenes.h"
#include "sim/implicit/equilibrium.h"
#include "sim/implicit/find_modes.h"
#include "sim/implicit/modes.h"

namespace unfurl::sim::smooth_modes_test {
namespace {

ModesReport ModesOf(const data::Scene& scene, int count, ModesSolver solver = ModesSolver::kAuto) {
  const Model model = Compile(scene);
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state;
  const EquilibriumReport report = FindEquilibrium(&dynamics, y.data());
  EXPECT_TRUE(report.found) << report.iterations << " " << report.acceleration;
  return FindModes(&dynamics, y.data(), count, solver);
}

ModesReport ModesOf(const std::string& toml, int count, ModesSolver solver = ModesSolver::kAuto) {
  return ModesOf(data::ParseScene(toml, "test.toml"), count, solver);
}

// Of 1 m, 1 kg and EI = 10 N m^2, so that (beta L)^2 sqrt(10) are its omegas.
std::string SmoothBeam(int order, const std::string& more = {}) {
  return fmt::format(
             "[scene]\nname = \"smooth\"\nduration = 1.0\n[beam.rod]\nlength = 1.0\nmass = 1.0\n"
             "EI = 10.0\nmodel = \"kirchhoff\"\norder = {}\n",
             order) +
         more;
}

double Omega(const ModesReport& report, std::size_t k) {
  return 2.0 * M_PI * report.modes.at(k).frequency;
}

constexpr double kFree[] = {4.73004074486270, 7.85320462409584, 10.9956078380017};
constexpr double kClamped[] = {1.87510406871196, 4.69409113297418, 7.85475743823761};

// Its own weight hangs it, from wherever it starts; the mode is a rod's, omega^2 = 3 g / (2 L), but
// for its bending, a part of some omega^2 / (pi^4 EI / (m L^3)).
TEST(SmoothModes, ARodHangsFromAnyAngle) {
  for (const char* stretch : {"", "axial = \"elastic\"\nEA = 1e6\n"}) {
    for (const double theta : {-1.5, -0.4, 0.0, 0.4, 1.5}) {
      const ModesReport report =
          ModesOf(SmoothBeam(3, std::string(stretch) +
                                    fmt::format("[joint.hook]\ninner = \"ground\"\nouter = "
                                                "\"rod.start\"\ntheta = {}\n"
                                                "[gravity]\nacceleration = [0.0, -1.0]\n",
                                                theta)),
                  2);
      EXPECT_NEAR(Omega(report, 0), std::sqrt(1.5), 2e-3 * std::sqrt(1.5)) << theta << stretch;
    }
  }
}

// The shapes hold the free beam's own modes: exact but for rounding.
TEST(SmoothModes, FreeBeamIsExact) {
  const ModesReport report = ModesOf(SmoothBeam(4), 3);
  EXPECT_EQ(report.rigid, 3);
  for (std::size_t k = 0; k < 3; ++k) {
    const double exact = kFree[k] * kFree[k] * std::sqrt(10.0);
    EXPECT_NEAR(Omega(report, k), exact, 1e-9 * exact);
  }
}

// On strings of length L_s every point is pulled back alike: omega^2 grows by g / L_s, and what was
// rigid swings.
TEST(SmoothModes, StringsAddTheSameToEveryMode) {
  const ModesReport report = ModesOf(SmoothBeam(4, "[suspension]\nlength = 2.0\n"), 6);
  EXPECT_EQ(report.rigid, 0);
  ASSERT_EQ(report.modes.size(), 6u);
  const double sigma = 9.81 / 2.0;
  for (std::size_t k = 0; k < 6; ++k) {
    const double beam = k < 3 ? 0.0 : kFree[k - 3] * kFree[k - 3] * std::sqrt(10.0);
    const double exact = std::sqrt(beam * beam + sigma);
    EXPECT_NEAR(Omega(report, k), exact, 1e-9 * exact) << k;
  }
}

// From above, as of any basis, and falling with the order.
TEST(SmoothModes, CantileverConverges) {
  double last[3] = {1.0, 1.0, 1.0};
  for (const int order : {2, 4, 6, 8}) {
    const ModesReport report =
        ModesOf(SmoothBeam(order, "[weld.root]\ninner = \"ground\"\nouter = \"rod.start\"\n"), 3);
    EXPECT_EQ(report.rigid, 0);
    for (std::size_t k = 0; k < 3; ++k) {
      const double error = Omega(report, k) / (kClamped[k] * kClamped[k] * std::sqrt(10.0)) - 1.0;
      EXPECT_GT(error, -1e-8) << order << " " << k;
      EXPECT_LT(error, std::max(0.5 * last[k], 1e-8)) << order << " " << k;
      last[k] = error;
    }
  }
  EXPECT_LT(last[0], 1e-6);
  EXPECT_LT(last[2], 1e-3);
}

// Pinned at both ends under an axial load P: omega_k^2 = (k pi)^4 EI / (m L^3) (1 - P / (k^2 P_1)),
// P_1 = pi^2 EI / L^2; what the load turns with the beam is all of it.
TEST(SmoothModes, AxialLoadSoftensAndStiffens) {
  for (const double part : {-2.0, 0.0, 0.5, 0.9}) {
    const double load = part * M_PI * M_PI * 10.0;
    const ModesReport report =
        ModesOf(SmoothBeam(6, fmt::format("[joint.a]\ninner = \"ground\"\nouter = \"rod.start\"\n"
                                          "[joint.b]\ntype = \"pin_in_slot\"\ninner = \"ground\"\n"
                                          "outer = \"rod.end\"\ntravel = 1.0\n"
                                          "[force.f]\non = \"rod.end\"\nforce = [{}, 0.0]\n",
                                          -load)),
                3);
    for (std::size_t k = 0; k < 3; ++k) {
      const double wave = static_cast<double>((k + 1) * (k + 1));
      const double exact = wave * M_PI * M_PI * std::sqrt(10.0) * std::sqrt(1.0 - part / wave);
      EXPECT_NEAR(Omega(report, k), exact, 1e-4 * exact) << part << " " << k;
    }
  }
}

TEST(SmoothModes, LoadBeyondBucklingGrows) {
  const std::string ends =
      "[joint.a]\ninner = \"ground\"\nouter = \"rod.start\"\n"
      "[joint.b]\ntype = \"pin_in_slot\"\ninner = \"ground\"\nouter = \"rod.end\"\ntravel = 1.0\n";
  const Model model =
      ModelFrom(SmoothBeam(6, ends + fmt::format("[force.f]\non = \"rod.end\"\nforce = [{}, 0.0]\n",
                                                 -15 * M_PI * M_PI)));
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state;
  const ModesReport report = FindModes(&dynamics, y.data(), 2);
  ASSERT_EQ(report.modes.size(), 2u);
  const double exact = M_PI * M_PI * std::sqrt(10.0) * std::sqrt(0.5);
  EXPECT_NEAR(report.modes[0].growth, exact, 1e-4 * exact);
  EXPECT_GT(report.modes[1].frequency, 0.0);
}

// Frequencies of segments, n and 2 n, continued to none.
std::vector<double> OfSegments(data::Scene scene, int n, int count) {
  std::vector<double> coarse, fine;
  for (const auto& [out, segments] : {std::pair{&coarse, n}, {&fine, 2 * n}}) {
    for (data::SceneBeam& beam : scene.beams) {
      beam.model = data::BeamModel::kSegments;
      beam.segments = segments;
    }
    for (const NaturalMode& mode : ModesOf(scene, count).modes) out->push_back(mode.frequency);
  }
  for (std::size_t k = 0; k < fine.size(); ++k) fine[k] += (fine[k] - coarse[k]) / 3.0;
  return fine;
}

// Beams that hang through under a tip mass, on springs, with an offset weld and strings: everything
// that turns with a beam, at a state that is far from straight.
TEST(SmoothModes, BentScenesAgreeWithSegments) {
  const std::string two =
      "[scene]\nname = \"two\"\nduration = 1.0\n"
      "[beam.a]\nlength = 0.8\nmass = 0.4\nEI = 1.5\ndamping = 1e-4\nmodel = \"kirchhoff\"\n"
      "order = 7\n"
      "[beam.b]\nlength = 0.6\nmass = 0.3\nEI = 0.9\ndamping = 2e-4\nmodel = \"kirchhoff\"\n"
      "order = 7\n"
      "[body.tip]\nmass = 0.15\ninertia = 0.002\n"
      "[joint.root]\ninner = \"ground\"\nouter = \"a.start\"\ntheta = 0.1\n"
      "[joint.root.spring]\nstiffness = 9.0\npreload = 0.2\n[joint.root.damper]\ndamping = 0.02\n"
      "[joint.knee]\ninner = \"a.end\"\nouter = \"b.start\"\ntheta = -0.2\n"
      "[joint.knee.spring]\nstiffness = 5.0\npreload = 0.0\n"
      "[weld.w]\ninner = \"b.end\"\nouter = \"tip\"\nouter_point = [-0.05, 0.02]\n";
  for (const std::string& pull :
       {std::string("[gravity]\nacceleration = [0.0, -9.81]\n"),
        std::string("[suspension]\nlength = 0.5\n[force.f]\non = \"a.end\"\nforce = [0.4, -1.2]\n"),
        std::string("[spring.s]\na = \"ground\"\na_point = [1.2, 0.9]\nb = \"b.end\"\n"
                    "stiffness = 6.0\nfree_length = 0.4\n")}) {
    const data::Scene scene = data::ParseScene(two + pull, "test.toml");
    const ModesReport smooth = ModesOf(scene, 5);
    const std::vector<double> segments = OfSegments(scene, 24, 5);
    ASSERT_EQ(smooth.modes.size(), segments.size());
    for (std::size_t k = 0; k < segments.size(); ++k) {
      EXPECT_NEAR(smooth.modes[k].frequency, segments[k], 1e-3 * segments[k]) << pull << k;
    }
  }
}

// The deployment that ships, latched, of smooth beams: dampings too, and both solvers.
TEST(SmoothModes, LatchedDeployment) {
  data::Scene scene = data::ReadScene(DeploymentPath("clearance"));
  for (auto& joint : scene.joints) joint.theta = -joint.latch->theta_b;
  const auto modes = [&](ModesSolver solver) {
    const Model model = Compile(scene);
    Dynamics dynamics(model);
    std::vector<double> y = model.initial_state;
    EXPECT_TRUE(FindLatchedEquilibrium(&dynamics, y.data()).found);
    return FindModes(&dynamics, y.data(), 6, solver);
  };
  for (data::SceneBeam& beam : scene.beams) {
    beam.segments = 32;
    beam.damping = 1e-4;
  }
  const ModesReport segments = modes(ModesSolver::kAuto);
  for (data::SceneBeam& beam : scene.beams) {
    beam.model = data::BeamModel::kKirchhoff;
    beam.order = 4;
  }
  const ModesReport dense = modes(ModesSolver::kDense), subspace = modes(ModesSolver::kSubspace);
  EXPECT_EQ(dense.rigid, 3);
  EXPECT_EQ(subspace.rigid, 3);
  ASSERT_EQ(dense.modes.size(), 6u);
  for (std::size_t k = 0; k < 6; ++k) {
    const double f = segments.modes[k].frequency, damping = segments.modes[k].damping;
    EXPECT_NEAR(dense.modes[k].frequency, f, 4e-3 * f) << k;
    EXPECT_NEAR(dense.modes[k].damping, damping, 2e-2 * damping) << k;
    EXPECT_NEAR(subspace.modes[k].frequency, dense.modes[k].frequency,
                1e-6 * dense.modes[k].frequency);
  }
}

// Shapes at parts of a beam and at marks: at the clamp nothing moves, the tip moves most, by 1.
TEST(SmoothModes, ShapesAreGivenAlongTheBeam) {
  const SceneModes modes = FindModes(data::ParseScene(
      SmoothBeam(4,
                 "[weld.root]\ninner = \"ground\"\nouter = \"rod.start\"\n"
                 "[mark.tip]\non = \"rod.end\"\n[mark.half]\non = \"rod\"\nat = 0.5\n"),
      "test.toml"));
  ASSERT_TRUE(modes.usable);
  const data::ModesRecord& record = modes.record;
  ASSERT_EQ(record.places.size(), 18u);
  EXPECT_EQ(record.places[0], "rod/1");
  const data::ModesRecord::Mode& first = record.modes.at(0);
  EXPECT_EQ(record.places[record.MovesMost(first)], "tip");
  EXPECT_NEAR(std::fabs(first.shape[16][1]), 1.0, 1e-12);
  EXPECT_LT(std::fabs(first.shape[0][1]), 0.01);
  for (std::size_t k = 0; k < 16; ++k) {
    EXPECT_NEAR(record.rest[k][0], (static_cast<double>(k) + 0.5) / 16.0, 1e-9);
    // The shape of a clamped beam, with z = beta L and its ratio of sine to cosine parts.
    const double z = kClamped[0], x = record.rest[k][0] * z;
    const double ratio = (std::cosh(z) + std::cos(z)) / (std::sinh(z) + std::sin(z));
    const double at = std::cosh(x) - std::cos(x) - ratio * (std::sinh(x) - std::sin(x));
    EXPECT_NEAR(first.shape[k][1] / first.shape[16][1], 0.5 * at, 1e-4) << k;
  }
}

}  // namespace
}  // namespace unfurl::sim::smooth_modes_test
