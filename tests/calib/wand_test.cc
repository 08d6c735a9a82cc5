#include "calib/wand.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "base/dense.h"
#include "base/error.h"
#include "base/pose.h"
#include "base/statistics.h"
#include "calib/block_chain.h"
#include "calib/verdict.h"
#include "calib/wand_shape.h"
#include "calib/wand_triple.h"
#include "measure/triangulate.h"
#include "tests/calib/fixtures.h"
#include "tests/calib/wand_fixtures.h"

namespace unfurl::calib {
namespace {

using testing::ErrorsOf;
using testing::MakeRig;
using testing::Observe;
using testing::PointsInCube;
using testing::RandomLab;
using testing::TracedLab;
using testing::TrueErrors;
using testing::Wave;
using testing::WaveBefore;
using testing::Waved;

// Against a dense inverse, with links and without.
TEST(BlockChain, IsTheDenseInverse) {
  Rng rng(3);
  const auto random = [&](Eigen::Index rows, Eigen::Index cols) {
    return Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return rng.Normal(); }).eval();
  };
  const std::vector<Eigen::Index> sizes = {3, 5, 5, 2};
  const std::vector<Eigen::Index> first = {0, 3, 8, 13};
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(15, 15);
  std::vector<Eigen::MatrixXd> diagonal, next(3), right;
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::MatrixXd root = random(sizes[k], sizes[k]);
    diagonal.emplace_back(root * root.transpose() +
                          10.0 * Eigen::MatrixXd::Identity(sizes[k], sizes[k]));
    dense.block(first[k], first[k], sizes[k], sizes[k]) = diagonal[k];
    right.push_back(random(sizes[k], 2));
    if (k == 0 || k == 2) continue;  // blocks 1 and 2 are not linked
    next[k - 1] = random(sizes[k - 1], sizes[k]);
    dense.block(first[k - 1], first[k], sizes[k - 1], sizes[k]) = next[k - 1];
    dense.block(first[k], first[k - 1], sizes[k], sizes[k - 1]) = next[k - 1].transpose();
  }
  const BlockChain chain(diagonal, next);
  const Eigen::MatrixXd inverse = dense.inverse();
  Eigen::MatrixXd all(15, 2);
  for (std::size_t k = 0; k < 4; ++k) all.middleRows(first[k], sizes[k]) = right[k];
  const Eigen::MatrixXd expected = inverse * all;
  const std::vector<Eigen::MatrixXd> solved = chain.Solve(right);
  const std::vector<Eigen::MatrixXd> blocks = chain.InverseDiagonal();
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_LT((solved[k] - expected.middleRows(first[k], sizes[k])).norm(), 1e-12);
    EXPECT_LT((blocks[k] - inverse.block(first[k], first[k], sizes[k], sizes[k])).norm(), 1e-12);
  }
}

// Pinholes without noise: three cameras and bars alone give the views back, but for a motion and a
// mirror.
TEST(WandTriple, FindsThreePinholesFromBars) {
  const auto rig = MakeRig({.cameras = 4, .pose_error = 0.1, .distortion = 0.0}, Rng(5));
  Rng rng(7);
  Eigen::Matrix3Xd from(3, 60), to(3, 60), a(3, 60), b(3, 60);
  for (Eigen::Index k = 0; k < from.cols(); ++k) {
    for (;;) {
      Eigen::Vector3d middle, direction;
      for (int i = 0; i < 3; ++i) {
        middle(i) = rng.Uniform(-0.8, 0.8);
        direction(i) = rng.Normal();
      }
      direction.normalize();
      a.col(k) = middle - 0.4 * direction;
      b.col(k) = middle + 0.4 * direction;
      bool seen = true;
      for (int j = 0; j < 3; ++j) {
        double u = 0.0, v = 0.0;
        seen = seen && measure::Project(rig[static_cast<std::size_t>(j)], a.col(k), &u) &&
               measure::Project(rig[static_cast<std::size_t>(j)], b.col(k), &v);
        from(j, k) = (u - 1079.5) / 2160.0;
        to(j, k) = (v - 1079.5) / 2160.0;
      }
      if (seen) break;
    }
  }
  const std::vector<TriplePinholes> found = FitTriple(from, to, 24, 3, Rng(1));
  ASSERT_FALSE(found.empty());
  // The weak priors pull by a few thousandths.
  Eigen::Matrix3Xd truth(3, 120), marks(3, 120);
  for (Eigen::Index k = 0; k < 60; ++k) {
    Eigen::Vector3d p;
    ASSERT_TRUE(found[0].Find(from.col(k), &p));
    marks.col(2 * k) = 0.8 * p;
    ASSERT_TRUE(found[0].Find(to.col(k), &p));
    marks.col(2 * k + 1) = 0.8 * p;
    truth.col(2 * k) = a.col(k);
    truth.col(2 * k + 1) = b.col(k);
  }
  EXPECT_LT(std::min(FitRigid(truth, marks).rms, FitRigid(truth, -marks).rms), 0.02);
}

// How far the bar's marks as found are from where they were, after the best rigid motion.
double MarksRms(const WandFit& fit, const Waved& waved, bool mirror) {
  Eigen::Matrix3Xd truth(3, 2 * fit.data.pose_count()), found = truth;
  std::vector<double> after(waved.data.readings.size() * 2, 0.0);
  for (const WandReading& r : fit.data.readings) {
    after[static_cast<std::size_t>(2 * r.pose + r.mark)] = r.after;
  }
  for (int k = 0; k < fit.data.pose_count(); ++k) {
    const int pose = std::stoi(fit.data.poses[static_cast<std::size_t>(k)]) - 1;
    for (int mark = 0; mark < 2; ++mark) {
      truth.col(2 * k + mark) = waved.marks.col(2 * pose + mark);
      found.col(2 * k + mark) =
          fit.state.Mark(k, mark, after[static_cast<std::size_t>(2 * k + mark)]);
    }
  }
  return FitRigid(truth, mirror ? Eigen::Matrix3Xd(-found) : found).rms;
}

// The errors of found points with their whole covariance, in the survey's frame.
struct Nees {
  double sum = 0.0, n = 0.0;
  int inside = 0, errors = 0;
  void Add(const TrueErrors& found) {
    for (std::size_t k = 0; k < found.error.size(); ++k) {
      const double squared = found.error[k].dot(found.predicted[k].llt().solve(found.error[k]));
      sum += squared / 3.0;
      n += 1.0;
      inside += squared < ChiSquareQuantile(0.95, 3.0) ? 1 : 0;
      ++errors;
    }
  }
};

Waved WithPoints(const std::vector<data::RigCamera>& truth, Wave wave, int points,
                 std::uint64_t seed) {
  const Rng rng(seed);
  Waved waved = WaveBefore(truth, wave, rng.Stream("wave"));
  waved.data.points =
      Observe(truth, PointsInCube(points, 1.0, rng.Stream("points")), 3e-4, 0.05, rng.Stream("n"));
  return waved;
}

TEST(Wand, WithEightPointsErrorBarsHold) {
  Nees nees;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const auto truth = MakeRig({}, Rng(seed).Stream("rig"));
    const Waved waved = WithPoints(truth, {.poses = 150, .half = 0.8}, 8, seed);
    WandOptions options;
    options.folds = 2;
    const WandCalibration result = CalibrateWand(waved.data, options, "wand");
    EXPECT_TRUE(result.report.converged);
    EXPECT_TRUE(result.fit.by_points);
    EXPECT_NE(result.rig.verdict, kDoNotUse) << result.rig.reasons.front();
    nees.Add(ErrorsOf(result.rig, truth, PointsInCube(60, 0.8, Rng(seed).Stream("check"))));
  }
  // Points of one rig share its error: three rigs have some 3 x 6 independent numbers.
  EXPECT_LT(nees.sum / nees.n, 2.0);
  EXPECT_GT(nees.sum / nees.n, 0.3);
}

// Rays through glass, cameras of any number, no guess, no point: distances.
TEST(Wand, FromNothingThroughGlass) {
  for (const std::uint64_t seed : {2U, 3U, 25U}) {  // 4, 7 and 3 cameras
    double half = 0.0;
    const data::Lab lab = RandomLab(seed, &half);
    const TracedLab traced(lab, half, seed);
    Wave wave{.poses = 150, .length = 0.7 * half, .length_sigma = 1e-4 * half, .half = 0.8 * half};
    wave.reading_sigma = 0.03;
    const Waved waved = WaveBefore(traced, wave);
    const WandFit fit = FitWand(waved.data, {}, "wand");
    EXPECT_TRUE(fit.summary.converged);
    const double rms = std::min(MarksRms(fit, waved, false), MarksRms(fit, waved, true));
    EXPECT_LT(rms, 5e-4 * half) << seed;
  }
}

TEST(Wand, SaysThatNothingTellsTheMirrorImage) {
  const auto truth = MakeRig({}, Rng(4));
  const Waved waved = WaveBefore(truth, {.poses = 120, .half = 0.8}, Rng(4));
  WandOptions options;
  options.folds = 2;
  const WandCalibration plain = CalibrateWand(waved.data, options, "wand");
  EXPECT_FALSE(plain.report.handed);
  EXPECT_NE(plain.rig.verdict, kGood);
  // Where the cameras were meant to stand tells it, decimetres off.
  for (const data::RigCamera& camera : truth) {
    options.frame.layout.push_back({camera.name, camera.p_WC + Eigen::Vector3d(0.05, -0.1, 0.08),
                                    Eigen::Vector3d(0.1, 0.0, -0.05)});
  }
  const WandCalibration planned = CalibrateWand(waved.data, options, "wand");
  EXPECT_TRUE(planned.report.handed);
  EXPECT_LT(MarksRms(planned.fit, waved, false), 1e-3);
  // What no frame changes is known as well: the image scale, to which the mirror means nothing.
  const double scale = planned.rig.covariance(6, 6);
  EXPECT_NEAR(plain.rig.covariance(6, 6), scale, 0.02 * scale);
}

TEST(Wand, TheFrameIsByNamedCameras) {
  const auto truth = MakeRig({}, Rng(6));
  const Waved waved = WaveBefore(truth, {.poses = 120, .half = 0.8}, Rng(6));
  WandOptions options;
  options.folds = 2;
  options.frame.cameras = {"c1", "c3", "c2"};
  const WandCalibration result = CalibrateWand(waved.data, options, "wand");
  const auto place = [&](int k) { return result.rig.cameras[static_cast<std::size_t>(k)].p_WC; };
  EXPECT_LT(place(0).norm(), 1e-12);
  EXPECT_LT(place(2).tail<2>().norm(), 1e-12);
  EXPECT_GT(place(2).x(), 0.0);
  EXPECT_LT(std::abs(place(1).z()), 1e-12);
  EXPECT_GT(place(1).y(), 0.0);
  // By definition these are known without error.
  const auto variance = [&](int camera, int axis) {
    const Eigen::Index at = data::kCameraParameters * camera + 3 + axis;
    return result.rig.covariance(at, at);
  };
  for (int axis = 0; axis < 3; ++axis) EXPECT_LT(variance(0, axis), 1e-16);
  EXPECT_LT(variance(2, 1) + variance(2, 2) + variance(1, 2), 1e-16);
  EXPECT_GT(variance(2, 0), 1e-10);
  options.frame.cameras = {"c1", "c3", "nobody"};
  EXPECT_THROW(CalibrateWand(waved.data, options, "wand"), Error);
}

TEST(Wand, MovesBetweenFlashes) {
  const auto truth = MakeRig({}, Rng(8));
  Wave wave{.poses = 120, .half = 0.8};
  wave.interval = 0.08;
  wave.flash = 0.004;
  wave.hertz = 0.3;
  const Waved waved = WaveBefore(truth, wave, Rng(8));
  const WandFit fit = FitWand(waved.data, {}, "wand");
  EXPECT_LT(std::min(MarksRms(fit, waved, false), MarksRms(fit, waved, true)), 1e-3);
  WandReport report;
  MotionOf(fit, &report);
  EXPECT_GT(report.speed, 0.2);
  EXPECT_GT(report.motion_sigma, 0.0);
#ifdef UNFURL_SLOW_TESTS  // every start is tried before it is given up
  // Taken as still, the same readings are off by what the bar moves, some millimetres.
  WandData still = waved.data;
  for (WandReading& r : still.readings) r.after = 0.0;
  WandOptions options;
  options.folds = 2;
  EXPECT_NE(CalibrateWand(still, options, "wand").rig.verdict, kGood);
#endif
}

TEST(Wand, NamesWhatAWaveLeavesOpen) {
  const auto truth = MakeRig({}, Rng(9));
  WandOptions options;
  options.folds = 2;
  Wave wave{.poses = 200, .half = 0.8};
  const WandCalibration all = CalibrateWand(WaveBefore(truth, wave, Rng(9)).data, options, "wand");
  // Always along z: lengths across are open.
  wave.limit = [](Eigen::Vector3d*, Eigen::Vector3d* direction) {
    *direction = Eigen::Vector3d(0.02 * direction->x(), 0.02 * direction->y(), 1.0).normalized();
  };
  try {
    const WandCalibration upright =
        CalibrateWand(WaveBefore(truth, wave, Rng(9)).data, options, "wand");
    EXPECT_GT(upright.report.shapes[0].sigma, 5.0 * all.report.shapes[0].sigma);
    EXPECT_NE(upright.rig.verdict, kGood);
  } catch (const Error&) {
    SUCCEED();  // refused is as well
  }
  // A bar a tenth as long knows the scale as much worse.
  wave.limit = nullptr;
  wave.length = 0.075;
  const WandCalibration small =
      CalibrateWand(WaveBefore(truth, wave, Rng(9)).data, options, "wand");
  EXPECT_GT(small.report.shapes[0].sigma, 3.0 * all.report.shapes[0].sigma);
}

TEST(Wand, GrossErrorsDoLittle) {
  const auto truth = MakeRig({}, Rng(11));
  Waved waved = WithPoints(truth, {.poses = 150, .half = 0.8}, 10, 11);
  const Eigen::Matrix3Xd check = PointsInCube(60, 0.8, Rng(11).Stream("check"));
  const auto error = [&] {
    WandOptions options;
    options.folds = 2;
    return ErrorsOf(CalibrateWand(waved.data, options, "wand").rig, truth, check).Rms();
  };
  const double clean = error();
  Rng rng(12);
  for (WandReading& r : waved.data.readings) {
    if (rng.Uniform() > 0.03) continue;
    r.u_px += (rng.Uniform() < 0.5 ? -1.0 : 1.0) * rng.Uniform(5.0, 200.0);
  }
  // Of a mark that four cameras see any one may be the wrong one: such poses are lost, a fifth of
  // them, and no more.
  EXPECT_LT(error(), 1.7 * clean);
}

TEST(WandData, BarsAreReadStrictly) {
  const WandBar bar = ParseBar("0.7501m+-0.1mm", "--bar");
  ASSERT_EQ(bar.places.size(), 1U);
  EXPECT_DOUBLE_EQ(bar.places[0], 0.7501);
  EXPECT_DOUBLE_EQ(bar.sigma, 1e-4);
  EXPECT_EQ(ParseBar("25cm,0.75m+/-0.1mm", "--bar").places.size(), 2U);
  for (const char* wrong : {"0.75m", "m+-0.1mm", "0.75m+-0", "0.75m+-2m", "0+-1mm", ""}) {
    EXPECT_THROW(ParseBar(wrong, "--bar"), Error) << wrong;
  }
}

TEST(WandData, PosesComeInTheOrderOfTime) {
  data::WandReadings readings;
  readings.pose = {"2", "2", "1", "1"};
  readings.mark = {"b", "a", "a", "b"};
  readings.time = {0.31, 0.30, 0.10, 0.11};
  readings.cameras = {"x"};
  readings.u_px.setConstant(4, 1, 100.0);
  readings.s_px.setConstant(4, 1, 0.1);
  const WandBar bar{{0.5}, 1e-4};
  const WandData data = MakeWandData(readings, bar, nullptr, "wand", "");
  EXPECT_EQ(data.poses, (std::vector<std::string>{"1", "2"}));
  EXPECT_NEAR(data.time[1], 0.305, 1e-12);
  EXPECT_NEAR(data.readings[0].after, -0.005, 1e-12);
  EXPECT_TRUE(data.Moves());
  readings.time = {0.105, 0.30, 0.10, 0.11};
  EXPECT_THROW(MakeWandData(readings, bar, nullptr, "wand", ""), Error);  // they overlap
  readings.time.clear();
  EXPECT_FALSE(MakeWandData(readings, bar, nullptr, "wand", "").Moves());
  EXPECT_THROW(MakeWandData(readings, {{0.2, 0.5}, 1e-4}, nullptr, "wand", ""), Error);
}

#ifdef UNFURL_SLOW_TESTS

// 500 laboratories of every kind (UNFURL_WAND_RIGS of them where that is set).
TEST(WandStudy, RandomRigsConverge) {
  const char* asked = std::getenv("UNFURL_WAND_RIGS");
  const int rigs = asked != nullptr ? std::atoi(asked) : 500;
  int good = 0;
  for (int seed = 1; seed <= rigs; ++seed) {
    double half = 0.0;
    const data::Lab lab = RandomLab(static_cast<std::uint64_t>(seed), &half);
    const TracedLab traced(lab, half, static_cast<std::uint64_t>(seed));
    Wave wave{.poses = 200, .length = 0.7 * half, .length_sigma = 1e-4 * half, .half = 0.8 * half};
    wave.reading_sigma = 0.03;
    const Waved waved = WaveBefore(traced, wave);
    double rms = std::numeric_limits<double>::infinity();
    try {
      const WandFit fit = FitWand(waved.data, {}, "wand");
      rms = std::min(MarksRms(fit, waved, false), MarksRms(fit, waved, true));
    } catch (const Error& error) {
      std::printf("rig %d: %s\n", seed, error.what());
    }
    if (rms < 2e-3 * half) {
      ++good;
    } else {
      std::printf("rig %d of %zu cameras: %.2g of the half side\n", seed, lab.cameras.size(),
                  rms / half);
    }
  }
  std::printf("%d of %d rigs converged\n", good, rigs);
  EXPECT_GE(good, 0.99 * rigs);
}

// 500 poses and 8 points against 200 surveyed points, the fitted model as generator.
TEST(WandStudy, CoverageAndErrorAgainstTheSurvey) {
  const char* asked = std::getenv("UNFURL_WAND_REPEATS");
  const int repeats = asked != nullptr ? std::atoi(asked) : 100;
  Nees nees;
  double squares = 0.0, surveyed = 0.0;
  for (int seed = 1; seed <= repeats; ++seed) {
    const auto truth = MakeRig({}, Rng(static_cast<std::uint64_t>(seed)).Stream("rig"));
    const Rng rng(static_cast<std::uint64_t>(seed));
    const Waved waved =
        WithPoints(truth, {.poses = 500, .half = 0.8}, 8, static_cast<std::uint64_t>(seed));
    WandFit fit = FitWand(waved.data, {}, "wand");
    const FramedWand framed = SetFrame({}, "wand", &fit);
    data::Rig rig;
    rig.cameras = fit.state.cameras;
    rig.covariance = framed.covariance;
    rig.volume_low.setConstant(-1.1);
    rig.volume_high.setConstant(1.1);
    const Eigen::Matrix3Xd check = PointsInCube(100, 0.9, rng.Stream("check"));
    const TrueErrors errors = ErrorsOf(rig, truth, check);
    nees.Add(errors);
    squares += errors.Rms() * errors.Rms();
    const Observations survey =
        Observe(truth, PointsInCube(200, 1.1, rng.Stream("survey")), 3e-4, 0.05, rng.Stream("s"));
    const double other = ErrorsOf(FitRig(survey, {}, "survey").rig, truth, check).Rms();
    surveyed += other * other;
  }
  const double ratio = std::sqrt(squares / surveyed);
  const double coverage = static_cast<double>(nees.inside) / nees.errors;
  std::printf("error %.3f of the surveyed calibration's; NEES/3 %.3f; coverage %.4f\n", ratio,
              nees.sum / nees.n, coverage);
  EXPECT_LT(ratio, 1.5);
  EXPECT_GT(coverage, 0.93);
  EXPECT_LT(coverage, 0.97);
}

#endif  // UNFURL_SLOW_TESTS

}  // namespace
}  // namespace unfurl::calib
