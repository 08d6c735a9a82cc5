// What a trial says of its cameras: faults of known size and place, through glass.
#include "measure/health.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>

#include "base/error.h"
#include "measure/expose.h"
#include "measure/reconstruct.h"
#include "tests/measure/fixtures.h"
#include "tests/measure/health_trial.h"
#include "tests/repeats.h"

namespace unfurl::measure::health_test {
namespace {

using ::testing::HasSubstr;

constexpr double kSigma = 0.02;  // of readings [px]

const HealthTrial& Four() {
  static const HealthTrial trial(4, 700);
  return trial;
}

struct Outcome {
  HealthReport report;
  std::size_t usable = 0, wrong = 0;  // wrong: off by more than six of its sigmas
  double rms = 0.0;                   // [m]
  double nees = 0.0;                  // of error over its sigmas, mean over 3 [-]
};

Outcome Go(const HealthTrial& trial, const data::TrialReadings& readings, const data::Rig& rig,
           bool correct) {
  Outcome out;
  const data::Tracks tracks =
      Reconstruct(readings, rig, {.workers = 1}, nullptr, correct, &out.report);
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (!data::Usable(tracks.status[i])) continue;
    ++out.usable;
    const SampleError error = ErrorOf(tracks, i, trial.truth()[i]);
    out.wrong += error.e.squaredNorm() > 36.0 * error.C.trace();
    out.rms += error.e.squaredNorm();
    out.nees += error.Squared();
  }
  const double n = static_cast<double>(std::max<std::size_t>(1, out.usable));
  out.rms = std::sqrt(out.rms / n);
  out.nees /= n;
  return out;
}

class HealthOf : public ::testing::TestWithParam<Harm> {};

TEST_P(HealthOf, AHarmedCameraIsNamedAndPutRight) {
  Harm harm = GetParam();
  Rng rng(31);
  const data::Rig rig = Four().DrawRig(&rng);
  Rng same = rng;
  const Outcome clean = Go(Four(), Four().Draw({}, kSigma, &same), rig, false);
  const data::TrialReadings readings = Four().Draw(harm, kSigma, &rng);
  const Outcome left = Go(Four(), readings, rig, false), right = Go(Four(), readings, rig, true);
  ASSERT_EQ(left.report.faults.size(), 1U);
  const Fault& fault = left.report.faults[0];
  EXPECT_TRUE(fault.certain());
  EXPECT_EQ(fault.camera, harm.camera);
  EXPECT_EQ(fault.lag, harm.lag);
  if (harm.px != 0.0) {
    EXPECT_NEAR(fault.offset_px, harm.px, std::max(0.1 * std::abs(harm.px), 3.0 * fault.sigma_px));
  }
  if (harm.per_s != 0.0) {
    EXPECT_NEAR(fault.slope, harm.per_s, 3.0 * fault.slope_sigma + 0.01);
  }
  if (harm.from > 0.0) {
    EXPECT_LE(fault.earliest, harm.from);
    EXPECT_GE(fault.latest, harm.from - 0.002);
    EXPECT_LT(fault.latest - fault.earliest, 0.02);
  } else {
    EXPECT_FALSE(std::isfinite(fault.from));
  }
  // With the camera left out, with it put right: nothing wrong is claimed, and hardly any is lost.
  EXPECT_EQ(left.wrong + right.wrong, 0U);
  EXPECT_GE(left.usable, static_cast<std::size_t>(0.95 * static_cast<double>(clean.usable)));
  EXPECT_GE(right.usable, clean.usable - 10);
  EXPECT_LT(right.rms, 1.2 * clean.rms);
  EXPECT_LT(right.nees, 1.5 * std::max(1.0, clean.nees));
}

INSTANTIATE_TEST_SUITE_P(Faults, HealthOf,
                         ::testing::Values(Harm{.camera = 1, .px = 0.3, .from = 0.3},
                                           Harm{.camera = 2, .px = -1.0, .from = -1.0},
                                           Harm{.camera = 0, .px = 5.0, .from = 0.4},
                                           Harm{.camera = 3, .from = -1.0, .lag = 1},
                                           Harm{.camera = 1, .from = 0.3, .lag = 5},
                                           Harm{.camera = 2, .from = -1.0, .lag = -2},
                                           Harm{.camera = 3, .per_s = 1.0}));

TEST(Health, SoundTrialsAreCalledSoundWithWildReadingsToo) {
  for (std::uint64_t draw = 0; draw < 6; ++draw) {
    Rng rng(400 + draw);
    const data::Rig rig = Four().DrawRig(&rng);
    data::TrialReadings readings = Four().Draw({}, kSigma, &rng);
    // Reflections, half of them always at the same distance.
    for (std::size_t i = 0; i < readings.u_px.size(); ++i) {
      if (std::isnan(readings.u_px[i]) || rng.Uniform(0.0, 1.0) > 0.02) continue;
      readings.u_px[i] += draw % 2 == 0 ? 3.0 : rng.Uniform(-40.0, 40.0);
    }
    const Outcome outcome = Go(Four(), readings, rig, false);
    EXPECT_THAT(outcome.report.faults, ::testing::IsEmpty()) << draw;
    EXPECT_EQ(outcome.report.unknown, "");
  }
}

TEST(Health, AFaultIsFoundAmongWildReadings) {
  Rng rng(8);
  const data::Rig rig = Four().DrawRig(&rng);
  data::TrialReadings readings = Four().Draw({.camera = 1, .px = 0.5, .from = 0.3}, kSigma, &rng);
  for (std::size_t i = 0; i < readings.u_px.size(); ++i) {
    if (rng.Uniform(0.0, 1.0) < 0.02) readings.u_px[i] += rng.Uniform(-40.0, 40.0);
  }
  const Outcome outcome = Go(Four(), readings, rig, true);
  ASSERT_EQ(outcome.report.faults.size(), 1U);
  EXPECT_EQ(outcome.report.faults[0].camera, 1);
  EXPECT_NEAR(outcome.report.faults[0].offset_px, 0.5, 0.05);
}

// Readings that follow no law, as of a lamp that the camera takes for the mark, or of a broken
// cable: in some flashes they, or a sound camera's of other lines, fit by chance. Nobody else is
// blamed, let alone left out.
TEST(Health, ReadingsWithoutALawBlameNobodyElse) {
  for (const int cameras : {4, 5, 6}) {
    const HealthTrial trial(cameras, 700);
    const auto draws = static_cast<std::uint64_t>(Repeats(3, 9));  // each kind once or thrice
    for (std::uint64_t draw = 0; draw < draws; ++draw) {
      Rng rng(40 + draw);
      const data::Rig rig = trial.DrawRig(&rng);
      data::TrialReadings readings = trial.Draw({}, kSigma, &rng);
      const auto bad = static_cast<std::size_t>(rng.Integer(static_cast<std::uint64_t>(cameras)));
      const auto c = static_cast<std::size_t>(cameras);
      const double row = rig.cameras[bad].pixels, stuck = rng.Uniform(0.2, 0.8) * row;
      for (std::size_t i = readings.size() / 2; i < readings.size(); ++i) {
        double& u = readings.u_px[c * i + bad];
        if (std::isnan(u)) continue;
        if (draw % 3 == 0) u = rng.Uniform(0.0, row - 1.0);
        if (draw % 3 == 1) u = stuck;
        if (draw % 3 == 2) u += rng.Uniform(-30.0, 30.0);
      }
      const Outcome outcome = Go(trial, readings, rig, false);
      for (const Fault& fault : outcome.report.faults) {
        EXPECT_EQ(fault.camera, static_cast<int>(bad)) << cameras << " " << draw;
      }
      EXPECT_EQ(outcome.wrong, 0U) << cameras << " " << draw;
      if (cameras == 4) continue;  // no two of the others agree on anything
      EXPECT_GE(outcome.usable, trial.truth().size() - 10) << cameras << " " << draw;
    }
  }
}

TEST(Health, TwoFaultsOfFiveCamerasAreBothNamed) {
  const HealthTrial five(5, 700);
  Rng rng(12);
  const data::Rig rig = five.DrawRig(&rng);
  data::TrialReadings readings = five.Draw({.camera = 4, .px = 2.0, .from = 0.4}, kSigma, &rng);
  for (std::size_t i = 0; i < readings.size(); ++i) readings.u_px[5 * i + 1] += 1.0;
  const Outcome outcome = Go(five, readings, rig, true);
  ASSERT_EQ(outcome.report.faults.size(), 2U);
  for (const Fault& fault : outcome.report.faults) {
    EXPECT_TRUE(fault.certain());
    EXPECT_NEAR(fault.offset_px, fault.camera == 4 ? 2.0 : 1.0, 0.1);
  }
  EXPECT_NE(outcome.report.faults[0].camera, outcome.report.faults[1].camera);
  EXPECT_EQ(outcome.wrong, 0U);
}

// Marks that do not move show that something is off, and not which camera: nothing is claimed.
TEST(Health, WhatCannotBeToldIsSaidAndNothingIsClaimed) {
  const HealthTrial still(4, 400, 2160, true);
  Rng rng(3);
  const data::Rig rig = still.DrawRig(&rng);
  const data::TrialReadings readings =
      still.Draw({.camera = 1, .px = 2.0, .from = 0.2}, kSigma, &rng);
  for (const bool correct : {false, true}) {
    const Outcome outcome = Go(still, readings, rig, correct);
    ASSERT_EQ(outcome.report.faults.size(), 1U);
    const Fault& fault = outcome.report.faults[0];
    EXPECT_FALSE(fault.certain());
    EXPECT_EQ(outcome.wrong, 0U);
    // Four of five lines of the first 0.2 s, but for those at the moment itself.
    EXPECT_GE(outcome.usable, 155U);
    EXPECT_LE(outcome.usable, 160U);
    EXPECT_THAT(Describe(fault, readings.cameras), HasSubstr("it cannot be told which"));
  }
}

TEST(Health, ThreeCamerasTellNothing) {
  const HealthTrial three(3, 300);
  Rng rng(3);
  const data::Rig rig = three.DrawRig(&rng);
  const Outcome outcome = Go(three, three.Draw({}, kSigma, &rng), rig, false);
  EXPECT_THAT(outcome.report.unknown, HasSubstr("three cameras leave no reading over"));
  EXPECT_GT(outcome.usable, 200U);
}

TEST(Health, OptionsThatMakeNoSenseAreRefused) {
  EXPECT_THROW(HealthOptions{.false_alarm = 0.0}.Check(), Error);
  EXPECT_THROW(HealthOptions{.doubt = 0.7}.Check(), Error);
  EXPECT_THROW(HealthOptions{.most_lag = -1}.Check(), Error);
}

TEST(Health, WordsSayWhatWhenAndHowMuch) {
  const std::vector<std::string> names = {"door", "window"};
  Fault fault{.camera = 1, .from = 3.21, .earliest = 3.20, .latest = 3.22, .offset_px = 1.0172};
  fault.sigma_px = 0.031;
  EXPECT_EQ(Describe(fault, names), "camera window moved by 1.017 +- 0.031 px at 3.210 +- 0.010 s");
  fault = {.kind = FaultKind::kLate, .camera = 0, .lag = -1};
  EXPECT_EQ(Describe(fault, names), "camera door is early by 1 line from the first line on");
}

// Through the sensors' own lines: a camera that is a line late shows its flashes in dark lines,
// too.
TEST(Health, LinesOfALateCameraArePutInStep) {
  const data::Lab lab = ShippedLab();
  data::Rig rig = ShippedRig();
  rig.model_floor_px = 0.002;  // as in Reconstruct's own test
  const std::string clean = testing::TempDir() + std::to_string(getpid()) + "in_step.h5";
  const std::string late = testing::TempDir() + std::to_string(getpid()) + "late.h5";
  data::Tracks truth;
  {
    data::TrialWriter writer(clean, HeaderOf(lab), {});
    ExposeTrial(lab, SwingingRun(0.5), writer, {}, &truth);
    writer.Commit();
  }
  constexpr std::size_t kCamera = 2;
  {
    const data::TrialReader trial(clean);
    data::TrialBlock block, other;
    trial.Read(0, trial.size(), &block);
    other = block;
    const std::size_t per = trial.header().line_counts();
    const std::size_t before = trial.header().format.ElementsBefore(kCamera);
    const std::size_t n = trial.header().format.Of(kCamera).elements();
    for (std::size_t i = 1; i < block.size(); ++i) {
      std::copy_n(&block.counts[(i - 1) * per + before], n, &other.counts[i * per + before]);
    }
    data::TrialWriter writer(late, trial.header(), {});
    writer.Append(other);
    writer.Commit();
  }
  HealthReport report;
  ReconstructSummary summary;
  const data::Tracks tracks =
      Reconstruct(data::TrialReader(late), rig, {}, &summary, true, &report);
  std::remove(clean.c_str());
  std::remove(late.c_str());
  ASSERT_EQ(report.faults.size(), 1U);
  EXPECT_EQ(Describe(report.faults[0], tracks.cameras),
            "camera south_west is late by 1 line from the first line on");
  ASSERT_EQ(tracks.size(), truth.size());
  EXPECT_GE(summary.usable(), truth.size() - 2);
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (!data::Usable(tracks.status[i])) continue;
    const auto col = static_cast<Eigen::Index>(i);
    EXPECT_LT((tracks.p.col(col) - truth.p.col(col)).norm(), 300e-6);
  }
}

}  // namespace
}  // namespace unfurl::measure::health_test
