// What a bar reaches, over many rigs: the accept figures of docs/verification.md, with rays through
// glass as the truth where the model's own errors matter.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "base/dense.h"
#include "base/error.h"
#include "base/statistics.h"
#include "calib/verdict.h"
#include "calib/wand.h"
#include "tests/calib/wand_fixtures.h"

namespace unfurl::calib::wand_study_test {
namespace {

using testing::MarksRms;
using testing::Observe;
using testing::PointsInCube;
using testing::RandomLab;
using testing::Reader;
using testing::TracedLab;
using testing::Wave;
using testing::WaveBefore;
using testing::Waved;

// How many repeats, unless the environment says otherwise.
int Repeats(const char* variable, int usual) {
  const char* asked = std::getenv(variable);
  return asked != nullptr ? std::atoi(asked) : usual;
}

// A random laboratory of its seed, and a bar waved before it.
struct RandomWave {
  double half = 0.0;
  data::Lab lab;
  TracedLab traced;

  explicit RandomWave(std::uint64_t seed) : lab(RandomLab(seed, &half)), traced(lab, half, seed) {}
  Waved Bar(const std::function<void(Eigen::Vector3d*, Eigen::Vector3d*)>& limit = nullptr,
            double length = 0.7) const {
    Wave wave{
        .poses = 200, .length = length * half, .length_sigma = 1e-4 * half, .half = 0.8 * half};
    wave.reading_sigma = 0.03;
    wave.limit = limit;
    return WaveBefore(traced, wave);
  }
};

// 500 laboratories of every kind: 3 to 8 cameras, sizes 0.5 to 2, rows of 1000 to 6000 pixels.
TEST(WandStudy, RandomRigsConverge) {
  constexpr double kRight = 2e-3;  // of the half side: the worst that is right is at a fifth of it
  const int rigs = Repeats("UNFURL_WAND_RIGS", 500), first = Repeats("UNFURL_WAND_FIRST", 1);
  int good = 0, wrong = 0;
  for (int seed = first; seed < first + rigs; ++seed) {
    const RandomWave random(static_cast<std::uint64_t>(seed));
    const Waved waved = random.Bar();
    WandOptions options;
    options.folds = 2;
    try {
      const WandCalibration found = CalibrateWand(waved.data, options, "wand");
      const double rms =
          std::min(MarksRms(found.fit, waved, false), MarksRms(found.fit, waved, true));
      const bool right = rms < kRight * random.half;
      good += right ? 1 : 0;
      const bool said = found.rig.verdict == kDoNotUse;
      wrong += !right && !said ? 1 : 0;
      if (right && !said) continue;
      std::printf("rig %d of %zu cameras: %.2g of the half side, \"%s\": %s\n", seed,
                  random.lab.cameras.size(), rms / random.half, found.rig.verdict.c_str(),
                  found.rig.reasons.front().c_str());
    } catch (const Error& error) {
      std::printf("rig %d of %zu cameras: %s\n", seed, random.lab.cameras.size(), error.what());
    }
  }
  std::printf("%d of %d rigs converged; %d wrong and not said\n", good, rigs, wrong);
  EXPECT_GE(good, 0.99 * rigs);
  EXPECT_EQ(wrong, 0);
}

// Motions that leave something open, before random laboratories: refused, or said, or within the
// error bars that are stated. Never good.
TEST(WandStudy, DegenerateMotionsAreNamed) {
  const int rigs = Repeats("UNFURL_WAND_RIGS", 30);
  for (int seed = 1; seed <= rigs; ++seed) {
    const RandomWave random(static_cast<std::uint64_t>(seed));
    const Eigen::Vector3d axis =
        GuessCameras(random.traced.Survey(60), {}, "survey")[0].camera.R_CW.row(1);
    const auto along = [&](Eigen::Vector3d*, Eigen::Vector3d* d) {
      *d = (axis + 0.02 * *d).normalized();
    };
    const auto plane = [](Eigen::Vector3d* p, Eigen::Vector3d* d) {
      p->z() *= 0.01;
      d->z() *= 0.01;
      d->normalize();
    };
    const struct {
      const char* name;
      Waved waved;
      const char* words[3];
    } cases[] = {
        {"along a lens axis",
         random.Bar(along),
         {"pointed least along", "not determined", "is known to"}},
        {"in one plane",
         random.Bar(plane),
         {"in one plane", "moved least along", "not determined"}},
        {"too short", random.Bar(nullptr, 0.02), {"is known to", "the bar's length", "bar"}}};
    for (const auto& motion : cases) {
      WandOptions options;
      options.folds = 2;
      try {
        const WandCalibration found = CalibrateWand(motion.waved.data, options, "wand");
        EXPECT_NE(found.rig.verdict, kGood) << motion.name << " " << seed;
        bool named = false;
        for (const std::string& reason : found.rig.reasons) {
          for (const char* words : motion.words) {
            named = named || reason.find(words) != std::string::npos;
          }
        }
        const double rms = std::min(MarksRms(found.fit, motion.waved, false),
                                    MarksRms(found.fit, motion.waved, true));
        std::printf("rig %d, %s: %s, %.2g of the half side, %s\n", seed, motion.name,
                    found.rig.verdict.c_str(), rms / random.half, named ? "named" : "NOT NAMED");
        EXPECT_TRUE(named || found.report.shapes[0].moved < 5e-4 * random.half)
            << motion.name << " " << seed << ": " << found.rig.reasons.front();
      } catch (const Error& error) {
        std::printf("rig %d, %s: %s\n", seed, motion.name, error.what());
      }
    }
  }
}

// Points as a rig finds them from true readings, and how the calibration's error moves each.
struct FoundPoints {
  std::vector<Eigen::Vector3d> truth, found;
  std::vector<Eigen::Matrix3Xd> factor;  // covariances are products of these [m]
};
FoundPoints Find(const data::Rig& rig, std::size_t cameras, const Reader& read,
                 const Eigen::Matrix3Xd& points) {
  const measure::Triangulator triangulator(rig, {.residual_level = 1e-12});
  Eigen::Matrix3Xd F(3, triangulator.shared_rank());
  FoundPoints out;
  std::vector<double> u(cameras), s(cameras, 0.05);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    bool all = true;
    for (std::size_t j = 0; j < cameras; ++j) all = read(j, points.col(i), &u[j]) && all;
    if (!all) continue;
    const measure::PointSolution point = triangulator.Solve(u, s, triangulator.centre());
    if (point.outcome != measure::PointOutcome::kSolved) continue;
    triangulator.SharedFactor(point, s, F);
    out.truth.emplace_back(points.col(i));
    out.found.push_back(point.p);
    out.factor.push_back(F);
  }
  return out;
}

// Errors of places (in the frame of surveyed points) and of distances across the volume.
struct Tally {
  double squares = 0.0, n = 0.0, nees = 0.0, inside = 0.0;
  void AddPlaces(const FoundPoints& points) {
    for (std::size_t k = 0; k < points.found.size(); ++k) {
      const Eigen::Vector3d error = points.found[k] - points.truth[k];
      const Eigen::Matrix3d predicted = points.factor[k] * points.factor[k].transpose();
      const double square = error.dot(predicted.llt().solve(error));
      squares += error.squaredNorm();
      nees += square / 3.0;
      inside += square < ChiSquareQuantile(0.95, 3.0) ? 1.0 : 0.0;
      n += 1.0;
    }
  }
  // What the frame does not do: after the best rigid motion.
  void AddShape(const FoundPoints& points) {
    Eigen::Matrix3Xd p(3, static_cast<Eigen::Index>(points.found.size())), q = p;
    for (std::size_t k = 0; k < points.found.size(); ++k) {
      p.col(static_cast<Eigen::Index>(k)) = points.truth[k];
      q.col(static_cast<Eigen::Index>(k)) = points.found[k];
    }
    squares += std::pow(FitRigid(p, q).rms, 2) * static_cast<double>(points.found.size());
    n += static_cast<double>(points.found.size());
  }
  double Rms() const { return std::sqrt(squares / n); }
  void AddDistances(const FoundPoints& points) {
    const std::size_t half = points.found.size() / 2;
    for (std::size_t k = 0; k < half; ++k) {
      const Eigen::Vector3d d = points.found[k + half] - points.found[k];
      const double error = d.norm() - (points.truth[k + half] - points.truth[k]).norm();
      const double predicted =
          (d.normalized().transpose() * (points.factor[k + half] - points.factor[k])).squaredNorm();
      squares += error * error;
      nees += error * error / predicted;
      inside += error * error < ChiSquareQuantile(0.95, 1.0) * predicted ? 1.0 : 0.0;
      n += 1.0;
    }
  }
};

// A bar with eight points, or none, against 200 surveyed points.
struct Against {
  Tally placed, surveyed;               // places, with eight points
  Tally shape, surveyed_shape;          // the same after the best rigid motion
  Tally distances, surveyed_distances;  // without any point
  int refused = 0;
  std::string verdicts;  // of the last, with points and without
  void Add(const Waved& waved, const Observations& few, const Observations& survey,
           std::size_t cameras, const Reader& read, const Eigen::Matrix3Xd& check) {
    WandOptions options;
    options.folds = 2;
    Waved with = waved;
    with.data.points = few;
    const WandCalibration by_points = CalibrateWand(with.data, options, "wand");
    const WandCalibration bare = CalibrateWand(waved.data, options, "wand");
    refused += by_points.rig.verdict == kDoNotUse || bare.rig.verdict == kDoNotUse ? 1 : 0;
    verdicts = by_points.rig.verdict + ", " + bare.rig.verdict;
    FoundPoints found = Find(by_points.rig, cameras, read, check);
    placed.AddPlaces(found);
    shape.AddShape(found);
    found = Find(bare.rig, cameras, read, check);
    distances.AddDistances(found);
    CalibrateOptions surveying;
    const data::Rig rig = FitRig(survey, surveying, "survey").rig;
    found = Find(rig, cameras, read, check);
    surveyed.AddPlaces(found);
    surveyed_shape.AddShape(found);
    surveyed_distances.AddDistances(found);
  }
  void Judge(const char* what, double bar_sigma) const {
    const auto print = [](const char* name, const Tally& wand, const Tally& survey, double of) {
      std::printf(
          "  %s: %.4f mm, %.3f of the surveyed calibration's; NEES %.3f, coverage %.4f "
          "(surveyed: %.3f, %.4f)\n",
          name, 1e3 * wand.Rms(), wand.Rms() / survey.Rms(), wand.nees / of, wand.inside / of,
          survey.nees / of, survey.inside / of);
    };
    std::printf("%s, a bar known to %.3g mm, %d not to be used\n", what, 1e3 * bar_sigma, refused);
    print("eight points, places", placed, surveyed, placed.n);
    std::printf(
        "  eight points, after the best rigid motion: %.4f mm, %.3f of the surveyed one's\n",
        1e3 * shape.Rms(), shape.Rms() / surveyed_shape.Rms());
    print("no point, distances", distances, surveyed_distances, distances.n);
    // The frame is the station's eight points': 0.25 mm over the volume, whatever the cameras do.
    EXPECT_LT(shape.Rms() / surveyed_shape.Rms(), 1.5);
    // Points of one rig share its error: of 100 rigs, some 600 numbers, 0.95 is known to 0.02.
    EXPECT_GT(placed.inside / placed.n, 0.93);
    EXPECT_GT(distances.inside / distances.n, 0.93);
    EXPECT_EQ(refused, 0);
  }
};

// Of the bar's length: what a tape gives, or a measuring machine (UNFURL_WAND_BAR_UM).
double BarSigma() { return 1e-6 * Repeats("UNFURL_WAND_BAR_UM", 20); }

TEST(WandStudy, AgainstTheSurveyByTheModel) {
  Against against;
  for (int repeat = 1; repeat <= Repeats("UNFURL_WAND_REPEATS", 100); ++repeat) {
    const Rng rng(static_cast<std::uint64_t>(repeat));
    const auto truth = testing::MakeRig({}, rng.Stream("rig"));
    const Reader read = [&](std::size_t j, const Eigen::Vector3d& p, double* u) {
      return measure::Project(truth[j], p, u) && *u >= 0.0 && *u <= testing::kPixels - 1.0;
    };
    against.Add(
        WaveBefore(truth, {.poses = 500, .length_sigma = BarSigma(), .half = 0.8},
                   rng.Stream("wave")),
        Observe(truth, PointsInCube(8, 1.0, rng.Stream("points")), 3e-4, 0.05, rng.Stream("n")),
        Observe(truth, PointsInCube(200, 1.1, rng.Stream("survey")), 3e-4, 0.05, rng.Stream("s")),
        truth.size(), read, PointsInCube(100, 0.9, rng.Stream("check")));
  }
  against.Judge("fitted model", BarSigma());
}

TEST(WandStudy, AgainstTheSurveyThroughGlass) {
  Against against;
  for (int repeat = 1; repeat <= Repeats("UNFURL_WAND_REPEATS", 100); ++repeat) {
    const TracedLab lab(static_cast<std::uint64_t>(repeat));
    Wave wave{.poses = 500, .length_sigma = BarSigma(), .half = 0.8};
    wave.reading_sigma = lab.reading_sigma;
    const Reader read = [&](std::size_t j, const Eigen::Vector3d& p, double* u) {
      return lab.Read(j, p, u);
    };
    against.Add(WaveBefore(lab, wave), lab.Survey(PointsInCube(8, 1.0, lab.rng.Stream("few"))),
                lab.Survey(200), lab.truth.cameras.size(), read,
                PointsInCube(100, 0.9, lab.rng.Stream("check")));
  }
  against.Judge("rays through glass", BarSigma());
}

// Laboratories of any kind, 4 to 8 cameras: ratios rig by rig, as one poor layout would drown all
// others.
TEST(WandStudy, AgainstTheSurveyInAnyLaboratory) {
  Tally placed, distances;
  std::vector<double> shapes, lengths;
  const int first = Repeats("UNFURL_WAND_FIRST", 1), rigs = Repeats("UNFURL_WAND_REPEATS", 20);
  for (int seed = first; seed < first + rigs; ++seed) {
    const RandomWave random(static_cast<std::uint64_t>(seed));
    TracedLab lab = random.traced;
    lab.reading_sigma = 0.03;
    if (lab.truth.cameras.size() < 4) continue;  // no reading is left over to check them
    Wave wave{.poses = 500,
              .length = 0.7 * random.half,
              .length_sigma = BarSigma() * random.half,
              .half = 0.8 * random.half};
    wave.reading_sigma = lab.reading_sigma;
    const Reader read = [&](std::size_t j, const Eigen::Vector3d& p, double* u) {
      return lab.Read(j, p, u);
    };
    Against one;
    one.Add(WaveBefore(lab, wave),
            lab.Survey(PointsInCube(8, 0.9 * random.half, lab.rng.Stream("few"))), lab.Survey(200),
            lab.truth.cameras.size(), read,
            PointsInCube(200, 0.8 * random.half, lab.rng.Stream("check")));
    if (!(one.distances.n > 0.0)) continue;  // no place that all cameras see
    shapes.push_back(one.shape.Rms() / one.surveyed_shape.Rms());
    lengths.push_back(one.distances.Rms() / one.surveyed_distances.Rms());
    for (const auto& [from, to] : {std::pair{&one.placed, &placed}, {&one.distances, &distances}}) {
      to->n += 1.0;  // each rig once, whatever number of places all its cameras see
      to->nees += from->nees / from->n;
      to->inside += from->inside / from->n;
    }
    std::printf(
        "%3d: %zu cameras, shape %.3f, distances %.3f of the surveyed one's; coverage %.3f, %.3f, "
        "NEES %.2f, %.2f; %s\n",
        seed, lab.truth.cameras.size(), shapes.back(), lengths.back(),
        one.placed.inside / one.placed.n, one.distances.inside / one.distances.n,
        one.placed.nees / one.placed.n, one.distances.nees / one.distances.n, one.verdicts.c_str());
    std::fflush(stdout);
  }
  ASSERT_FALSE(shapes.empty());
  std::printf("shape: median %.3f, largest %.3f; distances: %.3f, %.3f; coverage %.3f, %.3f\n",
              Median(shapes), Quantile(shapes, 1.0), Median(lengths), Quantile(lengths, 1.0),
              placed.inside / placed.n, distances.inside / distances.n);
  EXPECT_LT(Median(shapes), 1.5);
  EXPECT_GT(placed.inside / placed.n, 0.9);
  EXPECT_GT(distances.inside / distances.n, 0.9);
}

}  // namespace
}  // namespace unfurl::calib::wand_study_test
