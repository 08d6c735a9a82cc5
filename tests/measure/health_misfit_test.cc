// Readings that depart from where the calibration puts them for flashes on end, through glass.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>

#include "measure/health.h"
#include "measure/reconstruct.h"
#include "tests/measure/health_trial.h"
#include "tests/repeats.h"

namespace unfurl::measure::health_misfit_test {
namespace {

constexpr double kSigma = 0.02;  // of readings [px]
constexpr int kLines = 1000;

// What is added to a reading [px].
using Departure = std::function<double(std::size_t camera, double t, double u_px)>;

data::TrialReadings Departing(const HealthTrial& trial, std::size_t cameras, const Departure& by,
                              Rng* rng) {
  data::TrialReadings out = trial.Draw({}, kSigma, rng);
  for (std::size_t i = 0; i < out.u_px.size(); ++i) {
    out.u_px[i] += by(i % cameras, out.t[i / cameras], out.u_px[i]);
  }
  return out;
}

struct Outcome {
  HealthReport report;
  double squared = 0.0;               // errors over what is claimed, mean [-]
  std::size_t usable = 0, wrong = 0;  // wrong: off by more than six of its sigmas
};

Outcome Go(const HealthTrial& trial, const data::TrialReadings& readings, const data::Rig& rig) {
  Outcome out;
  const data::Tracks tracks =
      Reconstruct(readings, rig, {.workers = 1}, nullptr, false, &out.report);
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (!data::Usable(tracks.status[i])) continue;
    ++out.usable;
    const SampleError error = ErrorOf(tracks, i, trial.truth()[i]);
    out.squared += error.Squared();
    out.wrong += error.e.squaredNorm() > 36.0 * error.C.trace();
  }
  out.squared /= std::max<double>(1.0, static_cast<double>(out.usable));
  return out;
}

// Trials whose readings depart: nothing that is claimed is wrong, and error bars hold, told or not.
struct Trials {
  int trials = 0;
  double squared = 0.0;  // mean of those of whose samples some are usable

  void Add(const Outcome& outcome, const std::string& which) {
    EXPECT_EQ(outcome.wrong, 0U) << which;
    const bool told = outcome.report.misfit.wide || !outcome.report.faults.empty();
    EXPECT_TRUE(told || outcome.squared < Most(1)) << which << ": " << outcome.squared;
    if (outcome.usable > 0) squared += (outcome.squared - squared) / ++trials;
  }
  // What lasts is one draw of three numbers: squares over three have the variance 2/3.
  static double Most(int trials) { return 1.0 + 3.0 * std::sqrt(2.0 / 3.0 / trials); }
};

TEST(HealthMisfit, AnotherFinderOfSpotsIsToldAndInTheErrorBars) {
  const HealthTrial trial(6, kLines);
  Trials trials;
  for (int draw = 0; draw < Repeats(2, 24); ++draw) {
    Rng rng(560 + draw);
    // What two finders differ by in spots with coma: it grows with the field.
    std::array<double, 6> most;
    for (double& one : most) one = 0.3 * rng.Normal();
    const auto by = [&](std::size_t camera, double, double u_px) {
      const double x = (u_px - 1080.0) / 1080.0;
      return most[camera] * (3.0 * x * x * x - x);
    };
    const data::Rig rig = trial.DrawRig(&rng);
    trials.Add(Go(trial, Departing(trial, 6, by, &rng), rig), std::to_string(draw));
  }
  ASSERT_GT(trials.trials, 0);
  EXPECT_LE(trials.squared, Trials::Most(trials.trials));
}

TEST(HealthMisfit, AMountThatSwaysIsToldAndInTheErrorBars) {
  Trials trials;
  for (const std::size_t cameras : {4U, 5U}) {
    const HealthTrial trial(cameras, kLines);
    for (int draw = 0; draw < Repeats(1, 24); ++draw) {
      Rng rng(590 + draw);
      const std::size_t which = rng.Integer(cameras);
      const double most = rng.Uniform(0.2, 1.0), hertz = rng.Uniform(1.0, 6.0);
      const auto by = [&](std::size_t camera, double t, double) {
        return camera == which ? most * std::sin(2.0 * std::numbers::pi * hertz * t) : 0.0;
      };
      const data::Rig rig = trial.DrawRig(&rng);
      trials.Add(Go(trial, Departing(trial, cameras, by, &rng), rig),
                 std::to_string(cameras) + " cameras, draw " + std::to_string(draw));
    }
  }
  ASSERT_GT(trials.trials, 0);
  EXPECT_LE(trials.squared, Trials::Most(trials.trials));
}

TEST(HealthMisfit, ACameraThatRingsIsNotTakenForOthersThatMoved) {
  const std::size_t cameras = 4;
  for (const bool still : {false, true}) {
    const HealthTrial trial(cameras, kLines, 2160, still);
    for (int draw = 0; draw < Repeats(2, 24); ++draw) {
      Rng rng(630 + draw);
      const std::size_t which = rng.Integer(cameras);
      const double most = rng.Uniform(1.0, 10.0), hertz = rng.Uniform(3.0, 30.0);
      const double from = rng.Uniform(0.2, 0.7), fades = rng.Uniform(0.05, 0.5);
      const auto by = [&](std::size_t camera, double t, double) {
        if (camera != which || t < from) return 0.0;
        return most * std::exp((from - t) / fades) *
               std::sin(2.0 * std::numbers::pi * hertz * (t - from));
      };
      const data::Rig rig = trial.DrawRig(&rng);
      const Outcome outcome = Go(trial, Departing(trial, cameras, by, &rng), rig);
      EXPECT_EQ(outcome.wrong, 0U) << still << ", draw " << draw;
      for (const Fault& fault : outcome.report.faults) {
        const bool sure = fault.certain() && fault.kind != FaultKind::kLate;
        EXPECT_TRUE(!sure || fault.camera == static_cast<int>(which)) << still << ", draw " << draw;
      }
    }
  }
}

TEST(HealthMisfit, SoundTrialsHaveNone) {
  for (const std::size_t cameras : {4U, 6U}) {
    for (const bool still : {false, true}) {
      const HealthTrial trial(cameras, kLines, 2160, still);
      for (int draw = 0; draw < Repeats(1, 50); ++draw) {
        Rng rng(700 + 100 * static_cast<int>(cameras) + draw);
        const data::Rig rig = trial.DrawRig(&rng);
        const Outcome outcome = Go(trial, trial.Draw({}, kSigma, &rng), rig);
        EXPECT_FALSE(outcome.report.misfit.wide) << cameras << " " << still << " " << draw;
      }
    }
  }
}

}  // namespace
}  // namespace unfurl::measure::health_misfit_test
