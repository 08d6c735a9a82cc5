// Readings that scatter otherwise than stated, over rigs of three to eight cameras, through glass:
// what is told of it, and the marks' errors over what is then claimed.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <memory>

#include "base/statistics.h"
#include "measure/reconstruct.h"
#include "tests/measure/health_trial.h"

namespace unfurl::measure::scatter_slow_test {
namespace {

constexpr double kSigma = 0.02;  // stated [px]

const HealthTrial& Trial(std::size_t cameras) {
  static std::map<std::size_t, std::unique_ptr<HealthTrial>> made;
  auto& trial = made[cameras];
  if (!trial) trial = std::make_unique<HealthTrial>(cameras, 1000);
  return *trial;
}

// UNFURL_SCATTER_DRAWS: of every factor and rig; docs/verification.md has the figures of 30 and
// of 8.
int Draws() {
  const char* text = std::getenv("UNFURL_SCATTER_DRAWS");
  return text == nullptr ? 4 : std::atoi(text);
}

struct Outcome {
  HealthReport report;
  double nees = 0.0;  // over 3, mean [-]
  std::size_t usable = 0, samples = 0;
};

Outcome Go(const HealthTrial& trial, int camera, double factor, Rng* rng) {
  const data::Rig rig = trial.DrawRig(rng);
  const data::TrialReadings readings = trial.Scattered(camera, factor, kSigma, rng);
  Outcome out;
  const data::Tracks tracks =
      Reconstruct(readings, rig, {.workers = 1}, nullptr, false, &out.report);
  out.samples = tracks.size();
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (!data::Usable(tracks.status[i])) continue;
    ++out.usable;
    const SampleError error = ErrorOf(tracks, i, trial.truth()[i]);
    out.nees += error.Squared();
  }
  out.nees /= static_cast<double>(std::max<std::size_t>(1, out.usable));
  return out;
}

TEST(ScatterStudy, SoundTrialsAreCalledSoundAndTheRightCameraIsNamed) {
  fmt::print("cameras factor: told, right camera named, another named, of\n");
  for (const std::size_t cameras : {4U, 5U, 8U}) {
    const HealthTrial& trial = Trial(cameras);
    for (const double factor : {0.5, 1.0, 1.5, 2.0, 3.0}) {
      const int draws = (factor == 1.0 ? 10 : 2) * Draws();
      int told = 0, right = 0, wrong = 0;
      std::vector<double> z;
      for (int draw = 0; draw < draws; ++draw) {
        Rng rng(90000 + 1000 * cameras + static_cast<std::uint64_t>(draw));
        const data::Rig rig = trial.DrawRig(&rng);
        const ScatterReport report =
            ScatterOf(rig, trial.Scattered(1, factor, kSigma, &rng), kSigma);
        told += report.wide;
        if (factor == 1.0) z.push_back((report.all.factor - 1.0) / report.all.sigma);
        for (std::size_t c = 0; report.wide && c < cameras; ++c) {
          const Scatter& one = report.cameras[c];
          if (!(one.factor - 1.0 > 3.0 * one.sigma)) continue;
          (c == 1 ? right : wrong) += 1;
        }
      }
      fmt::print("{} {}: {}, {}, {}, {}; {:.2f}\n", cameras, factor, told, right, wrong, draws,
                 z.empty() ? 0.0 : Rms(z));
      if (factor == 1.0) {
        // 1% of false alarms: at most so many with a chance of one in a thousand or so.
        EXPECT_LE(told, 3 + draws / 30);
        EXPECT_NEAR(Rms(z), 1.0, 0.35);
      }
      EXPECT_LE(wrong, 1 + draws / 20);
      if (factor >= 2.0) {
        EXPECT_EQ(told, draws);
      }
    }
  }
}

TEST(ScatterStudy, ErrorsAreAsClaimedWhateverReadingsScatter) {
  fmt::print("cameras factor of: told, factor found and its sigma, error/sigma, NEES/3, usable\n");
  for (const std::size_t cameras : {3U, 4U, 5U, 8U}) {
    const HealthTrial& trial = Trial(cameras);
    for (const int camera : {-1, 1}) {
      for (const double factor : {0.5, 1.0, 1.5, 2.0, 3.0}) {
        if (camera >= 0 && factor == 1.0) continue;
        std::vector<double> nees, found, of, off;
        int told = 0, faults = 0;
        std::size_t usable = 0, samples = 0;
        for (int draw = 0; draw < Draws(); ++draw) {
          Rng rng(7000 + 100 * cameras + static_cast<std::uint64_t>(draw));
          const Outcome one = Go(trial, camera, factor, &rng);
          nees.push_back(one.nees);
          usable += one.usable;
          samples += one.samples;
          told += one.report.scatter.wide;
          faults += !one.report.faults.empty();
          if (!one.report.scatter.unknown.empty()) continue;
          const Scatter& scatter =
              camera < 0 ? one.report.scatter.all : one.report.scatter.cameras[1];
          found.push_back(scatter.factor);
          of.push_back(scatter.sigma);
          off.push_back((scatter.factor - factor) / scatter.sigma);
        }
        fmt::print(
            "{} {} {}: {}/{}, {:.3f} {:.3f} {:.2f}, {:.2f} ({:.2f}..{:.2f}), {:.3f} faults {}\n",
            cameras, factor, camera, told, Draws(), found.empty() ? 0.0 : Mean(found),
            of.empty() ? 0.0 : Mean(of), off.empty() ? 0.0 : Rms(off), Mean(nees),
            Quantile(nees, 0.0), Quantile(nees, 1.0),
            static_cast<double>(usable) / static_cast<double>(samples), faults);
      }
    }
  }
}

}  // namespace
}  // namespace unfurl::measure::scatter_slow_test
