#include "measure/lines_before.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "measure/dark_light.h"
#include "measure/expose.h"
#include "measure/reconstruct.h"
#include "tests/measure/spot_bench.h"

namespace unfurl::measure::lines_before_test {
namespace {

Spot Light(double u, double flux) {
  Spot spot;
  spot.u_px = u;
  spot.width_px = 3.0;
  spot.flux = flux;
  spot.flags = 0;
  return spot;
}

// A lamp stays where it is; a mark is where it was, as far as it goes from flash to flash.
TEST(DarkLight, IsAMarksWhereThatWas) {
  DarkLight of(2);
  const Spot first = Light(100.0, 500.0), second = Light(140.0, 500.0), other = Light(150.0, 400.0);
  of.Lit(0, &first, true);
  EXPECT_EQ(of.MarkOf(Light(104.0, 500.0)), -1);  // not seen to move yet
  of.Lit(0, &second, true);
  EXPECT_EQ(of.MarkOf(Light(180.0, 500.0)), 0);
  EXPECT_EQ(of.MarkOf(Light(300.0, 500.0)), -1);
  EXPECT_EQ(of.MarkOf(Light(180.0, 200.0)), -1);  // an edge of light that the mean lags behind
  of.Lit(1, &other, false);
  of.Lit(1, &other, false);
  EXPECT_EQ(of.MarkOf(Light(150.0, 500.0)), 0);  // beside another light in the line of the second
  of.Lit(0, nullptr, false);
  EXPECT_EQ(of.MarkOf(Light(150.0, 500.0)), 1);
  LitDark dark{.votes = std::vector<std::size_t>(2)};
  EXPECT_FALSE(dark.Add(1.0, std::vector{0, -1, -1, 1}));
  EXPECT_TRUE(dark.Add(2.0, std::vector{1, -1, 1, 0}));
  EXPECT_TRUE(dark.Add(3.0, std::vector{1, -1, 1, 1}));
  EXPECT_EQ(dark.lines, 2U);
  EXPECT_EQ(dark.mark(), 1);
  EXPECT_EQ(dark.from, 2.0);
  EXPECT_EQ(dark.until, 3.0);
}

TEST(LinesBefore, ASmallShareAtThePlaceOfEarlierLightIsExplained) {
  LinesBefore before(0.1);
  EXPECT_FALSE(before.Explain(Light(500.0, 1.0)));
  before.Add(std::vector{Light(500.0, 1000.0), Light(900.0, 200.0)});
  EXPECT_TRUE(before.Explain(Light(502.0, 20.0)));
  EXPECT_TRUE(before.Explain(Light(900.0, 19.0)));
  EXPECT_FALSE(before.Explain(Light(900.0, 21.0)));
  EXPECT_FALSE(before.Explain(Light(510.0, 20.0)));
  before.Add({});  // a dark line: of what was kept again a share is kept
  EXPECT_FALSE(before.Explain(Light(502.0, 20.0)));
  EXPECT_TRUE(before.Explain(Light(502.0, 9.0)));
  before.Add(std::vector{Light(501.0, 8.0)});  // seen: that is what there is
  EXPECT_FALSE(before.Explain(Light(502.0, 0.9)));
  EXPECT_TRUE(before.Explain(Light(502.0, 0.7)));
  before.Forget();
  EXPECT_FALSE(before.Explain(Light(502.0, 0.7)));
}

TEST(LinesBefore, LearnsWhatTheSensorKeeps) {
  SpotBench bench;
  Rng rng(3);
  bench.FindAll(rng);
  const double least = bench.finder().LeastFlux(3.0);
  const auto learn = [&](double kept, double flux, int lines, double dim = 1.0) {
    LinesBefore before(0.1);
    for (int i = 0; i < lines; ++i) {
      const double here = i % 2 == 0 ? 500.0 : 900.0, there = 1400.0 - here;
      const bool after = i % 4 == 1;  // the line before this one is of a dim mark
      std::vector<Spot> spots = {Light(here, i % 4 == 0 ? dim * flux : flux)};
      const double left = kept * (after ? dim : 1.0) * flux;
      if (left > least) spots.push_back(Light(there, left));
      before.Learn(spots, bench.finder());
      before.Add(spots);
    }
    before.Conclude();
    return before.share();
  };
  EXPECT_NEAR(learn(0.15, 1000.0 * least, 40), 0.30, 1e-9);
  EXPECT_NEAR(learn(0.01, 1000.0 * least, 40), 0.02, 1e-9);
  // None is seen: it is less than would be.
  EXPECT_NEAR(learn(0.0, 1000.0 * least, 40), 2e-3, 1e-9);
  EXPECT_NEAR(learn(0.0, 1000.0 * least, 40, 0.01), 2e-3, 1e-9);
  EXPECT_NEAR(learn(0.01, 1000.0 * least, 40, 0.01), 0.02, 1e-9);
  EXPECT_EQ(learn(0.0, 2.0 * least, 40), 0.1);      // dim light tells nothing
  EXPECT_EQ(learn(0.15, 1000.0 * least, 10), 0.1);  // so do few lines
  EXPECT_EQ(learn(0.4, 1000.0 * least, 40), 0.1);   // no sensor keeps that: it is a lamp
}

TEST(SpotFinder, LeastFluxIsWhatStandsOut) {
  constexpr int kRepeats = 200;
  for (const double sigma : {0.8, 2.0, 4.0}) {
    SpotBench bench;
    Rng rng(17);
    bench.FindAll(rng);
    const double least = bench.finder().LeastFlux(sigma) * bench.gain();
    const auto found = [&](double factor) {
      int count = 0;
      for (int i = 0; i < kRepeats; ++i) {
        bench.Clear();
        bench.AddGaussian(1500.0, 2.0, 30000.0);  // beside it, wide dim spots are not looked for
        bench.AddGaussian(700.0, sigma, factor * least);
        count += bench.FindAll(rng).size() == 2;
      }
      return count;
    };
    // Six sigmas of noise are the limit: three more, or fewer, are beyond it in 999 of 1000 cases,
    // and the noise of several pixels has a say.
    EXPECT_GT(found(9.0 / 6.0), kRepeats * 98 / 100) << sigma;
    EXPECT_LT(found(3.0 / 6.0), kRepeats * 2 / 100) << sigma;
  }
}

// The ghost of the line before would be the brightest of the line otherwise.
TEST(SpotFinder, ASpotSoFullThatItsFitFailsKeepsItsFlux) {
  SpotBench bench;
  Rng rng(5);
  bench.AddGaussian(700.0, 0.8, 40.0 * 60000.0);
  bench.AddGaussian(1200.0, 3.0, 20000.0);
  const std::vector<Spot> spots = bench.FindAll(rng);
  ASSERT_EQ(spots.size(), 2U);
  ASSERT_TRUE(spots[0].flags & kSpotSaturated);
  ASSERT_TRUE(spots[0].flags & kSpotPoorFit);
  EXPECT_GT(spots[0].flux, 2.0 * spots[1].flux);
}

// A trial of the shipped laboratory's cameras.
class Ghosts {
 public:
  explicit Ghosts(std::vector<std::string> settings) : settings_(std::move(settings)) {
    const data::Lab lab = ShippedLab(settings_);
    rig_ = FitRig(MakeVirtualRig(lab), lab.volume_low, lab.volume_high);
    rig_.model_floor_px = 0.02;  // what ghosts pull spots by that run over them
  }
  ~Ghosts() { std::remove(path_.c_str()); }
  Ghosts(const Ghosts&) = delete;
  Ghosts& operator=(const Ghosts&) = delete;

  const data::Rig& rig() const { return rig_; }
  const data::Tracks& truth() const { return truth_; }
  // The lines of the laboratory with these slots.
  data::TrialBlock Lines(const std::string& slots, data::TrialHeader* header) {
    std::vector<std::string> settings = settings_;
    settings.push_back("strobe.slots=" + slots);
    const data::Lab lab = ShippedLab(settings);
    data::TrialBlock block;
    {
      data::TrialWriter writer(path_, HeaderOf(lab), {});
      ExposeTrial(lab, SwingingRun(1.2), writer, {}, &truth_);
      writer.Commit();
    }
    const data::TrialReader trial(path_);
    *header = trial.header();
    trial.Read(0, trial.size(), &block);
    return block;
  }
  data::Tracks Reconstruct(const data::TrialHeader& header, const data::TrialBlock& block,
                           ReconstructSummary* summary) {
    data::TrialWriter writer(path_, header, {});
    writer.Append(block);
    writer.Commit();
    return measure::Reconstruct(data::TrialReader(path_), rig_, {}, summary);
  }
  // The largest error that is claimed [m].
  double Worst(const data::Tracks& tracks) const {
    double worst = 0.0;
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      if (!data::Usable(tracks.status[i])) continue;
      const auto col = static_cast<Eigen::Index>(i);
      worst = std::max(worst, (tracks.p.col(col) - truth_.p.col(col)).norm());
    }
    return worst;
  }

 private:
  std::vector<std::string> settings_;
  data::Rig rig_;
  data::Tracks truth_;
  std::string path_ = testing::TempDir() + std::to_string(getpid()) + "ghosts.h5";
};

constexpr char kAll[] = R"(["mark1", "mark1b", "mark2", "mark3", "dark"])";
constexpr double kNear = 2e-3;  // [m]; another mark is 0.1 m away and more

TEST(Reconstruct, WhatIsKeptOfTheLineBeforeIsNoMark) {
  for (const char* share : {"0.005", "0.04"}) {
    Ghosts trial({std::string("sensor.residual=") + share, "led.peak=0.9"});
    data::TrialHeader header;
    // From 1.2 s on the third mark's LED is dead: its lines are as dark ones at its place are.
    const data::TrialBlock dead =
        trial.Lines(R"(["mark1", "mark1b", "dark", "mark3", "dark"])", &header);
    data::TrialBlock block = trial.Lines(kAll, &header);
    std::size_t missing = 0;
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (block.t[i] < 1.2 || header.slots[static_cast<std::size_t>(block.slot[i])] != "mark2") {
        continue;
      }
      ++missing;
      const auto n = static_cast<std::ptrdiff_t>(header.line_counts());
      const auto from = static_cast<std::ptrdiff_t>(i) * n;
      std::copy(dead.counts.begin() + from, dead.counts.begin() + from + n,
                block.counts.begin() + from);
    }
    ASSERT_GT(missing, 20U);
    ReconstructSummary summary;
    const data::Tracks tracks = trial.Reconstruct(header, block, &summary);
    EXPECT_LT(trial.Worst(tracks), kNear) << share;
    EXPECT_EQ(summary.usable(), tracks.size() - missing) << share;
    const std::vector<std::string> dark = summary.DarkMarks();
    ASSERT_EQ(dark.size(), 1U) << share;
    EXPECT_NE(dark[0].find("no camera sees mark2 from 1.2"), std::string::npos) << dark[0];
    EXPECT_NE(dark[0].find("to the end"), std::string::npos) << dark[0];
  }
}

// From a moment on the LED of one mark is lit in all lines. In the mean of dark ones it would leave
// a ghost all along its way, which pulls the spots of others.
TEST(Reconstruct, AnLedThatStaysLitIsNamedAndLeavesNoGhost) {
  Ghosts trial({});
  data::TrialHeader header;
  const data::TrialBlock lit =
      trial.Lines(R"(["mark1", "mark1b+mark1", "mark2+mark1", "mark3+mark1", "dark"])", &header);
  const data::TrialBlock last =  // the same in what is named dark
      trial.Lines(R"(["dark", "mark1b", "mark2", "mark3", "mark1"])", &header);
  const data::TrialBlock sound = trial.Lines(kAll, &header);
  data::TrialBlock block = sound;
  for (std::size_t i = 0; i < block.size(); ++i) {
    if (block.t[i] < 1.2) continue;
    const bool dark = header.slots[static_cast<std::size_t>(block.slot[i])] == "dark";
    const std::vector<std::uint16_t>& counts = dark ? last.counts : lit.counts;
    const auto n = static_cast<std::ptrdiff_t>(header.line_counts());
    const auto from = static_cast<std::ptrdiff_t>(i) * n;
    std::copy(counts.begin() + from, counts.begin() + from + n, block.counts.begin() + from);
  }
  ReconstructSummary summary;
  const data::Tracks without = trial.Reconstruct(header, sound, &summary);
  EXPECT_TRUE(summary.LitDarkLines().empty());
  const data::Tracks tracks = trial.Reconstruct(header, block, &summary);
  // Twice the light in a line is 1.4 times its noise; the ghost makes it four times.
  EXPECT_LT(trial.Worst(tracks), 2.0 * trial.Worst(without));
  ASSERT_EQ(summary.LitDarkLines().size(), 1U);
  EXPECT_NE(summary.LitDarkLines()[0].find("show the light of mark1, from 1.20"), std::string::npos)
      << summary.LitDarkLines()[0];
}

// A mark of a twentieth of the others' light that crosses where the one before was: the sensor
// keeps less than that, as the record shows.
TEST(Reconstruct, ADimMarkThatCrossesTheOneBeforeIsNotLost) {
  Ghosts trial({"sensor.residual=0.005", "led.peak=0.9"});
  data::TrialHeader header;
  data::TrialBlock block = trial.Lines(kAll, &header);
  std::size_t dark = 0;
  const auto slot = [&](std::size_t i) {
    return header.slots[static_cast<std::size_t>(block.slot[i])];
  };
  while (slot(dark) != "dark") ++dark;
  const std::size_t n = header.line_counts();
  for (std::size_t i = 0; i < block.size(); ++i) {
    if (slot(i) != "mark2" || i + 1 == block.size()) continue;
    for (std::size_t k = 0; k < n; ++k) {
      const int level = block.counts[dark * n + k], light = block.counts[i * n + k] - level;
      if (light <= 20) continue;
      block.counts[i * n + k] = static_cast<std::uint16_t>(level + light / 20);
      std::uint16_t& next = block.counts[(i + 1) * n + k];  // what is kept of it, likewise
      next = static_cast<std::uint16_t>(next - std::lround(0.005 * 0.95 * light));
    }
  }
  // It does cross: in some camera it is read within some pixels of the mark before.
  std::size_t crossings = 0;
  std::vector<double> last(header.cameras.size(), -1.0);
  for (std::size_t i = 0; i < trial.truth().size(); ++i) {
    const data::Tracks& truth = trial.truth();
    const std::string& mark = truth.marks[static_cast<std::size_t>(truth.mark[i])];
    for (std::size_t c = 0; c < last.size(); ++c) {
      double u = 0.0;
      if (!Project(trial.rig().cameras[c], truth.p.col(static_cast<Eigen::Index>(i)), &u)) continue;
      crossings += mark == "mark2" && std::abs(u - last[c]) < 6.0;
      last[c] = u;
    }
  }
  ASSERT_GT(crossings, 3U);
  ReconstructSummary summary;
  const data::Tracks tracks = trial.Reconstruct(header, block, &summary);
  EXPECT_EQ(summary.usable(), tracks.size());
  EXPECT_LT(trial.Worst(tracks), kNear);
  std::size_t good = 0;
  for (const auto& counts : summary.status) good += counts[0];
  // Where two spots make one hill nothing helps; with a share of a tenth all crossings lose one.
  EXPECT_LT(tracks.size() - good, crossings / 2) << crossings;
}

}  // namespace
}  // namespace unfurl::measure::lines_before_test
