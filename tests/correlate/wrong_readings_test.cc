// Readings of channels that failed: runs of one value, and single gross ones in a comparison
// without a fit.
#include "correlate/compare/wrong_readings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "base/random.h"
#include "correlate/compare/channel_comparison.h"
#include "correlate/residual/held_readings.h"

namespace unfurl::correlate::wrong_readings_test {
namespace {

constexpr double kStep = 5e-3;
constexpr int kCount = 1200;

// A damped swing, in noise of `sigma` and steps of `resolution`.
data::Channel Swing(double sigma, double resolution, std::uint64_t seed) {
  Rng rng(seed);
  data::Channel c;
  c.name = "gauge", c.unit = "V";
  for (int i = 0; i < kCount; ++i) {
    const double t = kStep * i;
    double y = std::exp(-0.3 * t) * std::cos(2.0 * std::numbers::pi * 1.3 * t);
    y += sigma * rng.Normal();
    if (resolution > 0.0) y = resolution * std::round(y / resolution);
    c.t.push_back(t);
    c.y.push_back(y);
  }
  return c;
}

std::vector<HeldRun> RunsOf(const data::Channel& c) {
  return FindHeldRuns(
      c.t, Eigen::Map<const Eigen::VectorXd>(c.y.data(), static_cast<Eigen::Index>(c.y.size())));
}

TEST(HeldReadings, AreFoundWhereAnInstrumentDropsOut) {
  for (const double resolution : {0.0, 1e-4, 0.02}) {
    for (const bool zero : {true, false}) {
      data::Channel c = Swing(2e-3, resolution, 1);
      for (std::size_t i = 300; i < 340; ++i) c.y[i] = zero ? 0.0 : c.y[299];
      const std::vector<HeldRun> runs = RunsOf(c);
      ASSERT_EQ(runs.size(), 1U) << resolution << zero;
      EXPECT_NEAR(static_cast<double>(runs[0].first), 300.0, 1.0);
      EXPECT_NEAR(static_cast<double>(runs[0].count), 40.0, 1.0);
      EXPECT_EQ(runs[0].value, c.y[310]);
    }
  }
}

TEST(HeldReadings, AreNotWhatRestsOrIsClippedOrSwitches) {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    EXPECT_TRUE(RunsOf(Swing(2e-3, 0.0, seed)).empty());
    EXPECT_TRUE(RunsOf(Swing(2e-3, 1e-3, seed)).empty()) << "noise of two steps";
    data::Channel c = Swing(2e-3, 0.0, seed);
    for (double& y : c.y) y = std::clamp(y, -0.5, 0.5);
    EXPECT_TRUE(RunsOf(c).empty()) << "the end of a range";
  }
  EXPECT_TRUE(RunsOf(Swing(0.0, 0.02, 1)).empty()) << "an encoder, at rest between its counts";
  data::Channel c = Swing(0.0, 0.0, 1);
  for (std::size_t i = 0; i < 200; ++i) c.y[i] = c.y[200];
  EXPECT_TRUE(RunsOf(c).empty()) << "held until its release";
  for (std::size_t i = 0; i < c.y.size(); ++i) c.y[i] = (i / 150) % 2 == 0 ? 0.0 : 5.0;
  EXPECT_TRUE(RunsOf(c).empty()) << "switched";
}

// One reading off by a thousand sigmas: the same result as if it had never been made.
TEST(WrongReadings, ASpikeIsNamedAndChangesNothing) {
  const data::Channel sound = Swing(2e-3, 0.0, 3), reference = Swing(0.0, 0.0, 4);
  data::Channel wrong = sound, without = sound;
  wrong.y[500] += 2.0;
  for (std::vector<double>* v : {&without.t, &without.y}) v->erase(v->begin() + 500);
  const Comparison spiked = CompareChannels({wrong}, {reference});
  const Comparison left = CompareChannels({without}, {reference});
  ASSERT_EQ(spiked.scores.size(), 1U);
  EXPECT_NEAR(spiked.scores[0].score.rmse, left.scores[0].score.rmse,
              1e-3 * left.scores[0].score.rmse);
  EXPECT_THAT(spiked.reasons, ::testing::Contains(::testing::HasSubstr("readings of gauge: ")));
  EXPECT_THAT(spiked.reasons, ::testing::Contains(::testing::HasSubstr("at 2.5000 s")));
  for (const std::string& words : CompareChannels({sound}, {reference}).reasons) {
    EXPECT_THAT(words, ::testing::Not(::testing::HasSubstr("Gross")));
  }
  const Comparison alone = DescribeChannels({wrong});
  EXPECT_THAT(alone.reasons, ::testing::Contains(::testing::HasSubstr("at 2.5000 s")));
  EXPECT_EQ(alone.signals[0].measured, without.y);
  EXPECT_EQ(DescribeChannels({sound}).signals[0].measured, sound.y);
}

// A reading that was put aside leaves spectrum, peaks and rating as they are with the sound one.
TEST(WrongReadings, ASpikeLeavesTheSpectrum) {
  data::Channel sound = Swing(2e-3, 0.0, 3), reference = Swing(0.0, 0.0, 4);
  for (std::size_t i = 0; i < sound.y.size(); ++i) {
    const double more = 0.05 * std::cos(2.0 * std::numbers::pi * 11.0 * sound.t[i]);
    sound.y[i] += more, reference.y[i] += more;
  }
  data::Channel wrong = sound;
  wrong.y[500] += 2.0;
  const Comparison good = CompareChannels({sound}, {reference});
  const Comparison spiked = CompareChannels({wrong}, {reference});
  ASSERT_EQ(spiked.spectra.size(), 1U);
  const ComparedSpectrum &a = good.spectra[0], &b = spiked.spectra[0];
  EXPECT_THAT(b.note, ::testing::HasSubstr("put in where they are missing, 1 of"));
  EXPECT_EQ(a.measured.n, b.measured.n);
  ASSERT_GE(a.measured_peaks.size(), 2U);
  ASSERT_EQ(a.measured_peaks.size(), b.measured_peaks.size());
  for (std::size_t i = 0; i < a.measured_peaks.size(); ++i) {
    EXPECT_NEAR(a.measured_peaks[i].frequency, b.measured_peaks[i].frequency, 1e-3);
    EXPECT_NEAR(a.measured_peaks[i].amplitude, b.measured_peaks[i].amplitude, 1e-3);
  }
  EXPECT_NEAR(a.frac, b.frac, 1e-3);
  EXPECT_NEAR(good.scores[0].rating.overall, spiked.scores[0].rating.overall, 1e-3);
  EXPECT_EQ(good.scores[0].rating_step, spiked.scores[0].rating_step);
}

TEST(WrongReadings, ADropOutIsNamedAndLeftOut) {
  data::Channel c = Swing(2e-3, 0.0, 5);
  for (std::size_t i = 300; i < 320; ++i) c.y[i] = 0.0;
  const Comparison both = CompareChannels({c}, {Swing(0.0, 0.0, 4)});
  EXPECT_THAT(both.reasons,
              ::testing::Contains(::testing::HasSubstr("gauge dropped out: 20 readings")));
  EXPECT_LT(both.scores[0].score.rmse, 3e-3);
  const Comparison alone = DescribeChannels({c});
  EXPECT_EQ(alone.signals[0].t.size(), static_cast<std::size_t>(kCount - 20));
  EXPECT_THAT(alone.reasons,
              ::testing::Contains(::testing::HasSubstr("1.5000 to 1.5950 s, all 0 V")));
}

}  // namespace
}  // namespace unfurl::correlate::wrong_readings_test
