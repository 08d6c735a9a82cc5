// Cameras that were moved since a calibration that knows their lenses: rays through glass.
#include "calib/known_lens.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "base/dense.h"
#include "base/error.h"
#include "base/worker_pool.h"
#include "calib/calibrate.h"
#include "calib/covariance.h"
#include "calib/verdict.h"
#include "tests/calib/fixtures.h"
#include "tests/calib/traced.h"

namespace unfurl::calib::known_lens_test {
namespace {

using ::testing::HasSubstr;
using testing::NeesOf;
using testing::TracedLab;

constexpr std::size_t kRepeats = testing::Labs(8, 100);
constexpr int kMany = 150, kFew = 16, kChecks = 60;  // points

CalibrateOptions One() {
  CalibrateOptions options;
  options.workers = 1;
  return options;
}

struct Trial {
  double nees = 0.0, squares = 0.0, whole = 0.0, alone = 0.0;  // of found points; [m^2]
  bool alone_failed = false;
  // Of every camera: the error along its way over its sigma, the squared error over its covariance,
  // over 3, and the squared error along the way that was found.
  std::vector<double> along, moved, along_found, chance;
};
Trial TryOne(std::uint64_t seed) {
  TracedLab lab(seed);
  const data::Rig before = FitRig(lab.Survey(kMany), One(), "before").rig;
  const TracedLab was = lab;
  lab.Bump(5e-3, 5e-3);
  lab.rng = Rng(seed + 7000);
  const Observations few = lab.Survey(kFew);
  CalibrateOptions known = One();
  known.guess.known = KnownLensesOf(before);
  const data::Rig now = FitRig(few, known, "now").rig;
  Trial out;
  out.nees = NeesOf(lab, now, kChecks, &out.squares);
  NeesOf(lab, FitRig(lab.Survey(kMany), One(), "whole").rig, kChecks, &out.whole);
  try {
    NeesOf(lab, FitRig(few, One(), "alone").rig, kChecks, &out.alone);
  } catch (const Error&) {
    out.alone_failed = true;
  }
  const std::vector<KnownLensEstimate> lenses = CompareLenses(known.guess.known, now);
  for (std::size_t c = 0; c < lenses.size(); ++c) {
    const Eigen::Vector3d truth =
        lab.truth.cameras[c].X_WC.translation() - was.truth.cameras[c].X_WC.translation();
    const Eigen::Vector3d e = lenses[c].moved - truth;
    out.along.push_back(e.dot(truth.normalized()) / SigmaAlong(lenses[c].moved_covariance, truth));
    out.along_found.push_back(e.dot(lenses[c].moved.normalized()) / lenses[c].moved_sigma);
    out.moved.push_back(e.dot(lenses[c].moved_covariance.llt().solve(e)) / 3.0);
    out.chance.push_back(lenses[c].chance);
  }
  return out;
}

// A sixth of the points, and the error of all of them but for a factor; error bars that hold.
TEST(KnownLens, FewPointsDoAfterABump) {
  std::vector<Trial> all(kRepeats);
  ParallelFor(kRepeats, 0, [&](std::size_t k) { all[k] = TryOne(500 + k); });
  double nees = 0.0, squares = 0.0, whole = 0.0, alone = 0.0, low = 0.0;
  double moved = 0.0, along = 0.0, along_found = 0.0;
  double cameras = 0.0, fits = 0.0;
  for (const Trial& one : all) {
    nees += one.nees / static_cast<double>(kRepeats);
    squares += one.squares;
    whole += one.whole;
    if (!one.alone_failed) alone += one.alone, fits += 1.0;
    for (const double m : one.moved) moved += m;
    for (const double a : one.along) along += a * a;
    for (const double a : one.along_found) along_found += a * a;
    for (const double c : one.chance) low += c < 0.01 ? 1.0 : 0.0;
    cameras += static_cast<double>(one.moved.size());
  }
  const auto n = static_cast<double>(kRepeats);
  std::printf(
      "%zu laboratories: %d points and lenses known by %d: NEES/3 %.3f, RMS %.3f mm; from nothing "
      "by "
      "as many %.3f (%.0f failed), by %d %.3f; moves' NEES/3 %.2f of %.0f cameras, along the way "
      "that "
      "they went %.2f, that was found %.2f; lenses called others %.0f\n",
      kRepeats, kFew, kMany, nees, 1e3 * std::sqrt(squares / n), 1e3 * std::sqrt(alone / fits),
      n - fits, kMany, 1e3 * std::sqrt(whole / n), moved / cameras, cameras, along / cameras,
      along_found / cameras, low);
  // A survey's NEES/3 of points in one rig scatters by some 0.35.
  EXPECT_NEAR(nees, 1.0, 3.0 * 0.35 / std::sqrt(n));
  // Cameras of one laboratory share their points: as if three of four told something of their own.
  EXPECT_NEAR(moved / cameras, 1.0, 3.0 * std::sqrt(2.0 / 3.0 / (0.75 * cameras)));
  EXPECT_NEAR(along / cameras, 1.0, 3.0 * std::sqrt(2.0 / (0.75 * cameras)));
  EXPECT_LT(squares, 0.2 * alone * n / fits);
  EXPECT_LT(low, 0.01 * cameras + 3.0 * std::sqrt(0.01 * cameras) + 0.5);
}

// A lens that was refocused, by a change that its calibration would see: its camera is named,
// or found points are as good as they are said to be.
TEST(KnownLens, AnotherLensIsToldOrHarmless) {
  int told = 0, named = 0, trials = 0;
  for (const double factor : {1.01, 1.003, 1.001}) {
    for (std::uint64_t seed = 1; seed <= testing::Labs(1, 4); ++seed) {
      TracedLab lab(seed);
      CalibrateOptions options = One();
      data::Rig before = FitRig(lab.Survey(kMany), One(), "before").rig;
      before.cameras[1].f_px *= factor;
      options.guess.known = KnownLensesOf(before);
      lab.rng = Rng(seed + 7000);
      const Calibration now = Calibrate(lab.Survey(40), options, "now");
      const double nees = NeesOf(lab, now.rig, kChecks);
      const bool good = now.rig.verdict == kGood;
      EXPECT_TRUE(!good || nees < 1.6) << factor << ", " << seed << ": " << nees;
      if (factor < 1.01) continue;
      ++trials;
      told += good ? 0 : 1;
      const auto names = [&](const std::string& reason) {
        return reason.find("\"" + before.cameras[1].name + "\": its") != std::string::npos &&
               reason.find("lens is not the one") != std::string::npos;
      };
      const auto& reasons = now.rig.reasons;
      named += std::any_of(reasons.begin(), reasons.end(), names) ? 1 : 0;
    }
  }
  EXPECT_EQ(told, trials);
  EXPECT_EQ(named, trials);
}

TEST(KnownLens, BadInputIsNamed) {
  const TracedLab lab(3);
  data::Rig before = FitRig(lab.Survey(60), One(), "before").rig;
  auto message = [&](const data::Rig& rig, const Observations& data) {
    CalibrateOptions options = One();
    options.guess.known = KnownLensesOf(rig);
    try {
      FitRig(data, options, "test");
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  const Observations few = lab.Survey(kFew);
  data::Rig other = before;
  other.cameras[2].name = "spare";
  EXPECT_THAT(message(other, few), HasSubstr("is not among those whose lenses are known"));
  other = before;
  other.cameras[0].pixels = 1000;
  EXPECT_THAT(message(other, few), HasSubstr("had 1000 in the rig"));
  other = before;
  other.covariance.setZero();
  EXPECT_THAT(message(other, few), HasSubstr("states no uncertainty"));
  EXPECT_THAT(message(before, lab.Survey(6)), HasSubstr("survey at least 8"));
}

}  // namespace
}  // namespace unfurl::calib::known_lens_test
