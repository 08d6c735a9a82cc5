// A bar before cameras whose lenses a calibration before they were moved knows: rays through glass.
#include "calib/wand_lenses.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include "base/dense.h"
#include "base/error.h"
#include "base/statistics.h"
#include "base/worker_pool.h"
#include "calib/calibrate.h"
#include "calib/verdict.h"
#include "calib/wand.h"
#include "tests/calib/wand_fixtures.h"

namespace unfurl::calib::wand_lenses_test {
namespace {

using ::testing::Contains;
using ::testing::Each;
using ::testing::HasSubstr;
using testing::MakeRig;
using testing::MarksRms;
using testing::NeesOf;
using ::testing::Not;
using testing::TracedLab;
using testing::Wave;
using testing::WaveBefore;
using testing::Waved;

constexpr std::size_t kRepeats = testing::Labs(3, 40);
constexpr int kMany = 150, kChecks = 60;  // points

WandOptions Quick() {
  WandOptions options;
  options.folds = 2;
  options.workers = 1;
  return options;
}

std::vector<KnownLens> LensesBefore(const TracedLab& lab) {
  CalibrateOptions one;
  one.workers = 1;
  return KnownLensesOf(FitRig(lab.Survey(kMany), one, "before").rig);
}

// A short wave about a part of the volume, after each camera was bumped: lenses are known, and the
// rest of the volume with them.
TEST(WandLenses, AShortWaveDoesAfterABump) {
  struct Trial {
    double nees = 0.0, squares = 0.0, alone = 0.0, moved = 0.0;
    int cameras = 0, other = 0;
    double scale = 0.0;  // of the cameras' distances, less 1, over its sigma
  };
  std::vector<Trial> all(kRepeats);
  ParallelFor(kRepeats, 0, [&](std::size_t k) {
    TracedLab lab(900 + k);
    const std::vector<KnownLens> lenses = LensesBefore(lab);
    const TracedLab was = lab;
    lab.Bump(5e-3, 5e-3);
    lab.rng = Rng(7900 + k);
    Wave wave{.poses = 50, .length = 0.7, .half = 0.7};
    wave.reading_sigma = lab.reading_sigma;
    Waved waved = WaveBefore(lab, wave);
    waved.data.points = lab.Survey(8);
    Trial& one = all[k];
    NeesOf(lab, CalibrateWand(waved.data, Quick(), "alone").rig, kChecks, &one.alone);
    WandOptions options = Quick();
    options.fit.lenses = lenses;
    const WandCalibration known = CalibrateWand(waved.data, options, "known");
    one.scale = (known.report.against_before.scale - 1.0) / known.report.against_before.sigma;
    one.nees = NeesOf(lab, known.rig, kChecks, &one.squares);
    for (std::size_t c = 0; c < known.report.lenses.size(); ++c) {
      const KnownLensEstimate& lens = known.report.lenses[c];
      const Eigen::Vector3d truth =
          lab.truth.cameras[c].X_WC.translation() - was.truth.cameras[c].X_WC.translation();
      const Eigen::Vector3d e = lens.moved - truth;
      one.moved += e.dot(lens.moved_covariance.llt().solve(e)) / 3.0;
      one.other += lens.chance < 0.01 ? 1 : 0;
      ++one.cameras;
    }
  });
  double nees = 0.0, squares = 0.0, alone = 0.0, moved = 0.0, cameras = 0.0, other = 0.0;
  double scale = 0.0, widest = 0.0;
  for (const Trial& one : all) {
    nees += one.nees / static_cast<double>(kRepeats);
    squares += one.squares;
    alone += one.alone;
    moved += one.moved;
    cameras += one.cameras;
    other += one.other;
    scale += one.scale * one.scale / static_cast<double>(kRepeats);
    widest = std::max(widest, std::abs(one.scale));
  }
  const auto n = static_cast<double>(kRepeats);
  std::printf(
      "%zu laboratories, 50 poses and 8 points: NEES/3 %.3f, RMS %.3f mm, without lenses %.3f; "
      "moves' NEES/3 %.2f of %.0f cameras; lenses called others %.0f; scale against before %.2f "
      "RMS, "
      "%.2f widest\n",
      kRepeats, nees, 1e3 * std::sqrt(squares / n), 1e3 * std::sqrt(alone / n), moved / cameras,
      cameras, other, std::sqrt(scale), widest);
  // A rig's NEES/3 of points scatters by some 0.35.
  EXPECT_NEAR(nees, 1.0, 3.0 * 0.35 / std::sqrt(n));
  EXPECT_NEAR(moved / cameras, 1.0, 3.0 * std::sqrt(2.0 / 3.0 / (0.75 * cameras)));
  EXPECT_LT(squares, 0.5 * alone);
  // Student's t of 5 degrees of freedom, at 0.1% for each.
  EXPECT_LT(widest, StudentQuantile(1.0 - 0.5e-3, 5.0));
  EXPECT_LT(other, 0.01 * cameras + 3.0 * std::sqrt(0.01 * cameras) + 0.5);
}

#ifndef UNFURL_SLOW_TESTS

// Terms odd in y are of the camera as it is: its mirror image would have them the other way about.
TEST(WandLenses, TellTheRigFromItsMirrorImage) {
  for (std::uint64_t seed = 4; seed <= 5; ++seed) {
    const auto truth = MakeRig({}, Rng(seed));
    const Waved waved = WaveBefore(truth, {.poses = 120, .half = 0.8}, Rng(seed));
    WandOptions options = Quick();
    for (const data::RigCamera& camera : truth) {
      // Known to 0.1 px a term, and 0.1% of f: no lens is known better than by a good survey.
      Eigen::VectorXd sigma = Eigen::VectorXd::Constant(data::kCameraParameters, 0.1);
      sigma(6) = 1e-3 * camera.f_px;
      sigma(7) = 1.0;
      sigma(8) = 1e-3;
      options.fit.lenses.push_back({camera, sigma.cwiseAbs2().asDiagonal()});
    }
    const WandCalibration result = CalibrateWand(waved.data, options, "wand");
    EXPECT_TRUE(result.report.handed) << seed;
    EXPECT_LT(MarksRms(result.fit, waved, false), 1e-3) << seed;
    EXPECT_GT(MarksRms(result.fit, waved, true), 0.1) << seed;
    // Where it was is in another frame, and nothing is said of that.
    for (const KnownLensEstimate& lens : result.report.lenses) {
      EXPECT_FALSE(lens.placed);
      EXPECT_TRUE(std::isnan(lens.moved_sigma));
      EXPECT_GT(lens.chance, 1e-3) << lens.camera;
    }
    EXPECT_THAT(result.rig.reasons, Each(Not(HasSubstr("from where it was"))));
  }
}

TEST(WandLenses, AnotherLensIsTold) {
  TracedLab lab(31);
  std::vector<KnownLens> lenses = LensesBefore(lab);
  lab.Bump(5e-3, 5e-3);
  Wave wave{.poses = 100, .length = 0.7, .half = 0.8};
  wave.reading_sigma = lab.reading_sigma;
  const Waved waved = WaveBefore(lab, wave);
  WandOptions options = Quick();
  options.fit.lenses = lenses;
  const auto told = [&] {
    return HasSubstr("camera \"" + lenses[1].camera.name + "\": its lens is not the one");
  };
  const data::Rig same = CalibrateWand(waved.data, options, "wand").rig;
  EXPECT_THAT(same.reasons, Each(Not(told())));
  options.fit.lenses[1].camera.f_px *= 1.01;  // refocused
  const data::Rig other = CalibrateWand(waved.data, options, "wand").rig;
  EXPECT_NE(other.verdict, kGood);
  EXPECT_THAT(other.reasons, Contains(told()));
}

// Bumped cameras stand as far from each other as before, but for their bumps; cameras that were put
// elsewhere tell nothing.
TEST(WandLenses, AWrongLengthIsToldByWhereTheCamerasWere) {
  const auto scale = HasSubstr("% further from each other");
  for (const double moved : {5e-3, 0.3}) {  // [m]
    for (std::uint64_t seed = 61; seed <= 63; ++seed) {
      TracedLab lab(seed);
      WandOptions options = Quick();
      options.fit.lenses = LensesBefore(lab);
      lab.Bump(moved, 5e-3);
      Wave wave{.poses = 40, .length = 0.7, .half = 0.6};
      wave.reading_sigma = lab.reading_sigma;
      Waved waved = WaveBefore(lab, wave);
      const data::Rig right = CalibrateWand(waved.data, options, "wand").rig;
      EXPECT_THAT(right.reasons, Each(Not(scale))) << seed;
      waved.data.place *= 1.03;
      const data::Rig wrong = CalibrateWand(waved.data, options, "wand").rig;
      if (moved > 0.1) continue;
      EXPECT_EQ(wrong.verdict, kWithCare) << seed;
      EXPECT_THAT(wrong.reasons, Contains(scale)) << seed;
    }
  }
}

TEST(WandLenses, OfOtherCamerasAreRefused) {
  const auto truth = MakeRig({}, Rng(4));
  const Waved waved = WaveBefore(truth, {.poses = 60, .half = 0.8}, Rng(4));
  const auto message = [&](const std::vector<KnownLens>& lenses) {
    WandOptions options = Quick();
    options.fit.lenses = lenses;
    try {
      CalibrateWand(waved.data, options, "wand");
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  std::vector<KnownLens> lenses;
  for (const data::RigCamera& camera : truth) {
    lenses.push_back(
        {camera, Eigen::MatrixXd::Identity(data::kCameraParameters, data::kCameraParameters)});
  }
  std::vector<KnownLens> some = lenses;
  some.pop_back();
  EXPECT_THAT(message(some), HasSubstr("is not among those whose lenses are known"));
  some = lenses;
  some[2].camera.lens = data::LensModel::kFisheye;
  EXPECT_THAT(message(some), HasSubstr("are of two models"));
  some = lenses;
  some[0].camera.pixels += 1;
  EXPECT_THAT(message(some), HasSubstr("pixels, and had"));
  some = lenses;
  some[1].covariance.setZero();
  EXPECT_THAT(message(some), HasSubstr("states no uncertainty"));
}

#endif  // UNFURL_SLOW_TESTS

}  // namespace
}  // namespace unfurl::calib::wand_lenses_test
