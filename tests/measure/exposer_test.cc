#include "measure/exposer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <vector>

#include "base/statistics.h"
#include "measure/background.h"
#include "measure/expose.h"
#include "measure/spot.h"
#include "tests/measure/fixtures.h"

namespace unfurl::measure::exposer_test {
namespace {

// Nothing but light and whole counts.
std::vector<std::string> Quiet(std::vector<std::string> more = {}) {
  std::vector<std::string> settings = {"sensor.shot_noise=false", "sensor.read_noise=0.0",
                                       "sensor.dark_drift=0.0", "sensor.bits=16"};
  settings.insert(settings.end(), more.begin(), more.end());
  return settings;
}

// Camera 0's electrons over the dark level in one line that an LED at p lights.
std::vector<double> Electrons(Exposer& exposer, const data::Lab& lab, const VirtualRig& rig,
                              const std::vector<Eigen::Vector3d>& places, double t = 0.5,
                              const Eigen::Vector3d& axis = Eigen::Vector3d::UnitZ()) {
  const Exposer::Led led{.instants = places, .axis = axis};
  const Exposer::Line line{.leds = {&led, places.empty() ? std::size_t{0} : std::size_t{1}},
                           .electrons = rig.flash_electrons,
                           .t = t,
                           .mains_phase = rig.mains_phase};
  std::vector<std::uint16_t> counts(lab.sensor.format.elements());
  exposer.Collect(0, line);
  exposer.Read(0, lab.sensor.dark_level, Rng(1), counts);
  std::vector<double> electrons;
  for (int k = 0; k < lab.sensor.format.active; ++k) {
    electrons.push_back(counts[lab.sensor.format.first_active() + static_cast<std::size_t>(k)] *
                            lab.sensor.format.electrons_per_count -
                        lab.sensor.dark_level);
  }
  return electrons;
}

double Total(const std::vector<double>& x) { return std::accumulate(x.begin(), x.end(), 0.0); }
double Centroid(const std::vector<double>& x) {
  double sum = 0.0, first = 0.0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    if (x[k] < 3.0) continue;  // electrons: above what 16 bits round
    sum += x[k];
    first += x[k] * static_cast<double>(k);
  }
  return first / sum;
}

const Eigen::Vector3d kMiddle(0.05, -0.1, 0.0);

struct LitRoom {
  explicit LitRoom(const std::vector<std::string>& overrides)
      : lab(ShippedLab(overrides)), rig(MakeVirtualRig(lab)), exposer(lab, rig) {}
  data::Lab lab;
  VirtualRig rig;
  Exposer exposer;
};

TEST(Exposer, WhatIsNotCalledForChangesNothing) {
  // Keys that say zero give the very counts that no keys give; one effect leaves the noise of the
  // others as it was.
  const Eigen::Matrix3Xd p = RandomPoints({-1, -1, -1}, {1, 1, 1}, 5, 4);
  data::Survey points;
  points.p = p;
  points.cov.setZero(6, 5);
  points.id = {"a", "b", "c", "d", "e"};
  const data::Survey plain = ExposeSurvey(ShippedLab(), points, {});
  const data::Survey zero =
      ExposeSurvey(ShippedLab({"sensor.odd_gain=0.0", "sensor.nonuniformity=0.0",
                               "sensor.blooming=0.0", "sensor.residual=0.0", "led.half_angle=0.0"}),
                   points, {});
  EXPECT_EQ(plain.lit, zero.lit);
  EXPECT_EQ(plain.dark, zero.dark);
  EXPECT_TRUE(plain.response.empty());
  const data::Survey offset = ExposeSurvey(ShippedLab({"sensor.odd_offset=3000.0"}), points, {});
  for (std::size_t k = 0; k < plain.lit.size(); ++k) {
    const bool odd = (k % 2235) % 2 == 1;  // 64 elements stand before the active ones
    const int change = static_cast<int>(offset.lit[k]) - static_cast<int>(plain.lit[k]);
    EXPECT_NEAR(change, odd ? 3000.0 / plain.format.electrons_per_count : 0.0, odd ? 1.0 : 0.0);
  }
}

TEST(Exposer, ResidualChargeIsTheGhostOfTheLineBefore) {
  constexpr double kCount = 1.0;  // electrons; 16 bits
  const double r = 0.1;
  LitRoom plain(Quiet()), ghost(Quiet({"sensor.residual=0.1"}));
  const double light = Total(Electrons(plain.exposer, plain.lab, plain.rig, {kMiddle}));
  ASSERT_GT(light, 20000.0);
  // A flash, then darkness: r^k (1 - r) of it in line k.
  double expected = (1.0 - r) * light;
  for (int k = 0; k < 4; ++k) {
    const double seen = Total(
        Electrons(ghost.exposer, ghost.lab, ghost.rig,
                  k == 0 ? std::vector<Eigen::Vector3d>{kMiddle} : std::vector<Eigen::Vector3d>{}));
    EXPECT_NEAR(seen, expected, 2160 * 0.1 + 30 * kCount) << k;
    expected *= r;
  }
  // A light that stays is read in full.
  double seen = 0.0;
  for (int k = 0; k < 10; ++k) {
    seen = Total(Electrons(ghost.exposer, ghost.lab, ghost.rig, {kMiddle}));
  }
  EXPECT_NEAR(seen, light, 30 * kCount);
  EXPECT_EQ(ResidualMemory(plain.lab.sensor), 0);
  EXPECT_EQ(ResidualMemory(ghost.lab.sensor), 6);
}

TEST(Exposer, ATrialsGhostsDoNotDependOnWhoComputesThem) {
  // The trial's second line shows the ghost of the first, wherever pieces of work begin.
  const data::Lab lab = ShippedLab(Quiet({"sensor.residual=0.05"}));
  const VirtualRig rig = MakeVirtualRig(lab);
  const data::Run run = SwingingRun(0.1);
  const std::string path = testing::TempDir() + "ghosts.h5";
  data::TrialWriter writer(path, HeaderOf(lab), {});
  ExposeTrial(lab, run, writer, {}, nullptr);
  writer.Commit();
  const data::TrialReader trial(path);
  data::TrialBlock block;
  trial.Read(0, trial.size(), &block);
  // Line 16 k is the first of a task: mark1b after mark1; all earlier lines in one go must agree.
  Exposer exposer(lab, rig);
  const MarkPath mark1(run, "mark1");
  std::vector<std::uint16_t> counts(lab.sensor.format.elements());
  const std::size_t elements = counts.size(), cameras = rig.cameras.size();
  std::vector<MarkPath> paths;
  for (const char* mark : {"mark1", "mark1b", "mark2", "mark3"}) paths.emplace_back(run, mark);
  const double half = 0.5 * lab.led.flash / std::sqrt(3.0);
  for (std::size_t line = 0; line < 40; ++line) {
    std::vector<Eigen::Vector3d> places;
    if (line % 5 < 4) {
      for (const double at : {block.t[line] - half, block.t[line] + half}) {
        places.push_back(rig.X_WM * paths[line % 5].At(at - rig.lead));
      }
    }
    const Exposer::Led led{.instants = places};
    exposer.Collect(0, {.leds = {&led, places.empty() ? std::size_t{0} : std::size_t{1}},
                        .electrons = rig.flash_electrons,
                        .t = block.t[line]});
    exposer.Read(0, lab.sensor.dark_level, Rng(1), counts);
    int differ = 0;
    for (std::size_t k = 0; k < elements; ++k) {
      differ = std::max(differ, std::abs(counts[k] - block.counts[line * cameras * elements + k]));
    }
    EXPECT_LE(differ, 1) << line;  // what is older than ResidualMemory is below a count
  }
  std::remove(path.c_str());
}

TEST(Exposer, MeanFlickerIsTheIntegral) {
  for (const double frequency : {50.0, 100.0, 1000.0}) {
    for (const double from : {0.0, 0.0123}) {
      const double until = from + 0.001, phase = 0.7, depth = 0.4;
      double sum = 0.0;
      constexpr int kSteps = 2000;
      for (int i = 0; i < kSteps; ++i) {
        const double t = from + (until - from) * (i + 0.5) / kSteps;
        sum += 1.0 + depth * std::sin(2.0 * M_PI * frequency * t + phase);
      }
      EXPECT_NEAR(MeanFlicker(depth, frequency, phase, from, until), sum / kSteps, 1e-6);
    }
  }
  EXPECT_NEAR(MeanFlicker(1.0, 100.0, 0.3, 0.2, 0.21), 1.0, 1e-12);  // a whole period
}

TEST(Exposer, AmbientLightFlickersOnActivePixelsOnly) {
  LitRoom s(Quiet({"ambient.level=2e6", "ambient.slope=0.5", "ambient.flicker=0.3"}));
  std::vector<double> means;
  for (int i = 0; i < 10; ++i) {
    const double t = 0.0005 + 0.001 * i;  // one period of 100 Hz in ten lines
    const std::vector<double> e = Electrons(s.exposer, s.lab, s.rig, {}, t);
    means.push_back(Mean(e));
    EXPECT_NEAR(e[2159] / e[0], 1.5 / 0.5, 0.01);
    EXPECT_NEAR(Mean(e) / 2000.0,
                MeanFlicker(0.3, 100.0, s.rig.mains_phase, t - 0.0005, t + 0.0005), 1e-3);
  }
  EXPECT_NEAR(Mean(means), 2000.0, 1.0);
  std::vector<std::uint16_t> counts(s.lab.sensor.format.elements());
  s.exposer.Collect(0, {.t = 0.2});
  s.exposer.Read(0, s.lab.sensor.dark_level, Rng(1), counts);
  for (std::size_t k = 0; k < s.lab.sensor.format.first_active(); ++k) {
    EXPECT_EQ(counts[k], counts[0]);
  }
}

TEST(Exposer, LampsShineInEveryLine) {
  LitRoom s(Quiet({"lamp.door.position=[0.05, -0.1, 0.0]", "lamp.door.brightness=0.5",
                   "lamp.door.flicker=0.0"}));
  LitRoom plain(Quiet());
  const std::vector<double> lamp = Electrons(s.exposer, s.lab, s.rig, {});
  const std::vector<double> led = Electrons(plain.exposer, plain.lab, plain.rig, {kMiddle});
  EXPECT_NEAR(Total(lamp) / Total(led), 0.5, 1e-3);
  EXPECT_NEAR(Centroid(lamp), Centroid(led), 1e-3);
}

TEST(Exposer, AMirrorShowsTheLedWhereItsImageIs) {
  // A pane in the plane x = 1.2; the image of p stands at 2.4 - x.
  const std::vector<std::string> mirror = {
      "reflection.pane.centre=[1.2, 0.0, 1.0]", "reflection.pane.normal=[1.0, 0.0, 0.0]",
      "reflection.pane.radius=3.0", "reflection.pane.reflectance=0.25"};
  LitRoom s(Quiet(mirror)), plain(Quiet());
  const Eigen::Vector3d p(0.9, 0.2, -0.1), image(1.5, 0.2, -0.1);
  const std::vector<double> both = Electrons(s.exposer, s.lab, s.rig, {p});
  const std::vector<double> direct = Electrons(plain.exposer, plain.lab, plain.rig, {p});
  const std::vector<double> second = Electrons(plain.exposer, plain.lab, plain.rig, {image});
  ASSERT_GT(Total(second), 5000.0);
  std::vector<double> left(2160);
  for (std::size_t k = 0; k < 2160; ++k) left[k] = both[k] - direct[k];
  EXPECT_NEAR(Total(left) / (0.25 * Total(second)), 1.0, 0.01);
  EXPECT_NEAR(Centroid(left), Centroid(second), 0.01);
  // Too small, or with its back between the two: nothing.
  LitRoom small(Quiet({mirror[0], mirror[1], "reflection.pane.radius=0.01", mirror[3]}));
  EXPECT_EQ(Electrons(small.exposer, small.lab, small.rig, {p}), direct);
  EXPECT_EQ(Electrons(s.exposer, s.lab, s.rig, {image}), second);
}

TEST(Exposer, AnOccluderHidesForAsLongAsItStandsThere) {
  const std::vector<std::string> plate = {
      "occluder.arm.centre=[0.55, 0.5, 1.5]", "occluder.arm.normal=[0.0, 0.0, 1.0]",
      "occluder.arm.radius=0.2", "occluder.arm.from=1.0", "occluder.arm.until=2.0"};
  LitRoom s(Quiet(plate)), plain(Quiet());
  const std::vector<double> free = Electrons(plain.exposer, plain.lab, plain.rig, {kMiddle});
  EXPECT_EQ(Electrons(s.exposer, s.lab, s.rig, {kMiddle}, 0.9), free);
  EXPECT_LT(Total(Electrons(s.exposer, s.lab, s.rig, {kMiddle}, 1.5)), 300.0);
  EXPECT_EQ(Electrons(s.exposer, s.lab, s.rig, {kMiddle}, 2.1), free);
}

TEST(Exposer, HalfASlitGivesHalfTheLightAndMovesTheCentreWhereItIsBlurred) {
  // A wide plate close before the slit covers its +x half. Near the camera the spot is out of
  // focus, and the centre goes by the half's own centroid: rays of each half, traced apart.
  LitRoom plain(Quiet({"mounting.position=0.0", "mounting.rotation=0.0"}));
  const LensCamera& camera = plain.rig.cameras[0];
  const Eigen::Vector3d p_W = camera.X_WC * Eigen::Vector3d(0.1, 0.05, 1.2);
  const Disc plate{.centre = camera.X_WC * Eigen::Vector3d(1.0, 0.0, 1e-4),
                   .normal = camera.X_WC.linear().col(2),
                   .radius = 1.0};
  const LightPath path{.occluders = {&plate, 1}};
  SpotLight whole, half;
  ASSERT_TRUE(TraceSpot(camera, p_W, &whole));
  ASSERT_TRUE(TraceSpot(camera, p_W, &half, &path));
  EXPECT_NEAR(half.flux / whole.flux, 0.5, 0.05);  // strips of a 24th
  double sum = 0.0, first = 0.0;
  for (int i = 0; i < 200; ++i) {
    const double x = -camera.slit_half_width * (i + 0.5) / 200.0;
    double y = 0.05 * 0.04 / 1.24;
    Landing landing, beside;
    for (int step = 0; step < 5; ++step) {
      ASSERT_TRUE(TraceThroughSlit(camera, camera.X_WC.inverse() * p_W, x, y, &landing));
      ASSERT_TRUE(TraceThroughSlit(camera, camera.X_WC.inverse() * p_W, x, y + 1e-5, &beside));
      y -= landing.across * 1e-5 / (beside.across - landing.across);
    }
    sum += 1.0;
    first += landing.u;
  }
  EXPECT_GT(std::abs(first / sum - whole.centre_px), 0.1);  // or it would test nothing
  EXPECT_NEAR(half.centre_px, first / sum, 0.1 * std::abs(first / sum - whole.centre_px));
}

TEST(Exposer, AnLedShinesLessAside) {
  LitRoom plain(Quiet()), s(Quiet({"led.half_angle=1.0472"}));  // 60 degrees: Lambert's cosine
  const double on_axis = Total(Electrons(plain.exposer, plain.lab, plain.rig, {kMiddle}));
  const Eigen::Vector3d towards = (s.rig.cameras[0].X_WC.translation() - kMiddle).normalized();
  const Eigen::Vector3d aside = towards.unitOrthogonal();
  for (const double angle : {0.0, 0.5, 1.0472, 1.4}) {
    const Eigen::Vector3d axis = std::cos(angle) * towards + std::sin(angle) * aside;
    EXPECT_NEAR(Total(Electrons(s.exposer, s.lab, s.rig, {kMiddle}, 0.5, axis)) / on_axis,
                std::cos(angle), 2e-3);
  }
  EXPECT_LT(Total(Electrons(s.exposer, s.lab, s.rig, {kMiddle}, 0.5, -towards)), 300.0);
}

TEST(Exposer, LightFallsWithTheSquareOfTheDistance) {
  LitRoom s(Quiet());
  const Eigen::Vector3d slit = s.rig.cameras[0].X_WC.translation();
  const Eigen::Vector3d sight = s.rig.cameras[0].X_WC.linear().col(2);
  // The row sees a sliver whose height in the slit is p Z / (Z + depth) times the glass' part.
  const double near = Total(Electrons(s.exposer, s.lab, s.rig, {slit + 2.5 * sight}));
  const double far = Total(Electrons(s.exposer, s.lab, s.rig, {slit + 4.0 * sight}));
  const double depth = 0.038;
  EXPECT_NEAR(near / far, std::pow(4.0 / 2.5, 2) * (2.5 / (2.5 + depth)) / (4.0 / (4.0 + depth)),
              0.01);
}

TEST(FlatField, TakesOutTheFixedPattern) {
  // Response 3% and an odd gain of 4%: without a flat field narrow spots are misread by tens of
  // sigmas; with one, what is left is its own noise.
  const std::vector<std::string> pattern = {"sensor.nonuniformity=0.03", "sensor.odd_gain=0.04",
                                            "sensor.odd_offset=150.0"};
  std::vector<std::string> with = pattern;
  with.insert(with.end(), {"flat_field.lines=200", "flat_field.level=0.6"});
  double rms[2];
  for (int flat = 0; flat < 2; ++flat) {
    const data::Lab lab = ShippedLab(flat == 1 ? with : pattern);
    const VirtualRig rig = MakeVirtualRig(lab);
    data::Survey points;
    points.p = RandomPoints({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}, 60, 4);
    points.cov.setZero(6, 60);
    for (int i = 0; i < 60; ++i) points.id.push_back(std::to_string(i));
    const data::Survey survey = ExposeSurvey(lab, points, {});
    ASSERT_EQ(survey.response.size(), flat == 1 ? 4U * 2160U : 0U);
    std::vector<double> whitened;
    for (std::size_t c = 0; c < 4; ++c) {
      Background background(survey.format);
      SpotFinder finder(survey.format);
      const std::size_t active = survey.response.size() / 4;
      finder.SetResponse(std::span<const float>(survey.response).subspan(c * active, active));
      const auto line = [&](const std::vector<std::uint16_t>& lines, std::size_t i) {
        return std::span<const std::uint16_t>(&lines[(i * 4 + c) * 2235], 2235);
      };
      for (std::size_t i = 0; i < 60; ++i) background.Add(line(survey.dark, i));
      for (std::size_t i = 0; i < 60; ++i) {
        SpotLight light;
        if (!TraceSpot(rig.cameras[c], points.p.col(static_cast<Eigen::Index>(i)), &light))
          continue;
        const Spot spot = finder.Find(line(survey.lit, i), background);
        if (Usable(spot)) whitened.push_back((spot.u_px - light.centre_px) / spot.s_px);
      }
    }
    ASSERT_GT(whitened.size(), 200U);
    rms[flat] = Rms(whitened);
  }
  EXPECT_GT(rms[0], 1.5);
  EXPECT_LT(rms[1], 1.25);  // 200 values know it to 5%; the shape of real spots adds a little
}

TEST(Exposer, LedsLitTogetherAreOneLineAndTwoSpots) {
  const data::Lab lab = ShippedLab({"strobe.slots=[\"mark1+mark2\", \"dark\"]"});
  const data::Run run = SwingingRun(0.1);
  const std::string path = testing::TempDir() + "together.h5";
  data::Tracks truth;
  data::TrialWriter writer(path, HeaderOf(lab), {});
  ExposeTrial(lab, run, writer, {}, &truth);
  writer.Commit();
  EXPECT_EQ(truth.marks, (std::vector<std::string>{"mark1", "mark2"}));
  const data::TrialReader trial(path);
  EXPECT_EQ(trial.header().slots, (std::vector<std::string>{"mark1+mark2", "dark"}));
  EXPECT_EQ(data::MarksOfSlot(trial.header().slots[0]), truth.marks);
  EXPECT_TRUE(data::MarksOfSlot("dark").empty());
  data::TrialBlock block;
  trial.Read(0, trial.size(), &block);
  Background background(lab.sensor.format);
  for (std::size_t i = 1; i < 60; i += 2) {
    background.Add({&block.counts[i * 4 * 2235], 2235});
  }
  const VirtualRig rig = MakeVirtualRig(lab);
  SpotFinder finder(lab.sensor.format);
  Spot spots[4];
  ASSERT_EQ(finder.FindAll({&block.counts[40 * 4 * 2235], 2235}, background, spots), 2U);
  double expected[2];
  for (int m = 0; m < 2; ++m) {
    SpotLight light;  // line 40 is the 21st lit one
    ASSERT_TRUE(TraceSpot(rig.cameras[0], truth.p.col(2 * 20 + m), &light));
    expected[m] = light.centre_px;
  }
  std::sort(expected, expected + 2);
  for (int m = 0; m < 2; ++m) EXPECT_NEAR(spots[m].u_px, expected[m], 6 * spots[m].s_px + 0.03);
  std::remove(path.c_str());
}

TEST(LensCamera, BiconvexSeesWhatThePlanoConvexSees) {
  // Two faces of twice the radius: the same power, so about the same picture.
  const VirtualRig plano = MakeVirtualRig(ShippedLab());
  const VirtualRig biconvex = MakeVirtualRig(ShippedLab({"lens.curved=both", "lens.radius=0.032"}));
  const Eigen::Matrix3Xd points = RandomPoints({-0.8, -0.8, -0.8}, {0.8, 0.8, 0.8}, 50, 2);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    SpotLight a, b;
    ASSERT_EQ(TraceSpot(plano.cameras[0], points.col(i), &a),
              TraceSpot(biconvex.cameras[0], points.col(i), &b));
    const double from_middle = a.centre_px - 1079.5;
    EXPECT_NEAR(b.centre_px, a.centre_px, 40.0 + 0.1 * std::abs(from_middle));
    EXPECT_NEAR(b.flux / a.flux, 1.0, 0.1);
  }
}

}  // namespace
}  // namespace unfurl::measure::exposer_test
