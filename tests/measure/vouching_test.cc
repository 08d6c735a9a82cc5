// What three cameras cannot say of themselves, and what marks on one rigid body say of them:
// through glass, by faults of known size.
#include "measure/vouching.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/statistics.h"
#include "measure/kept_distances.h"
#include "measure/reconstruct.h"
#include "tests/measure/health_trial.h"

namespace unfurl::measure::vouching_test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kSigma = 0.02;   // of readings [px]
constexpr double kLength = 1.2;   // of the bar [m]
constexpr double kStated = 1e-4;  // how well it is stated [m]

// The first two marks are the ends of a bar that tumbles through the volume.
Eigen::Vector3d Bar(int mark, double t) {
  if (mark > 1) return HealthTrial::Swing(mark, t);
  const double turn = 5.0 * t, tilt = 0.6 * std::sin(4.0 * t);
  const Eigen::Vector3d along(std::cos(tilt) * std::cos(turn), std::cos(tilt) * std::sin(turn),
                              std::sin(tilt));
  const Eigen::Vector3d middle(0.3 * std::sin(3.0 * t), 0.2, 0.3 * std::cos(2.0 * t));
  return middle + (mark == 0 ? -0.5 : 0.5) * kLength * along;
}

const HealthTrial& Three() {
  static const HealthTrial trial(3, 900, 2160, HealthTrial::Way(Bar));
  return trial;
}

const std::vector<KeptDistance>& TheBar() {
  static const std::vector<KeptDistance> bar = {
      {.a = "m0", .b = "m1", .length = kLength, .sigma = kStated}};
  return bar;
}

struct Outcome {
  HealthReport report;
  std::vector<double> moved;  // of usable samples, from `other`'s or the truth [m]
  double nees = 0.0;          // over 3, mean [-]
};

Outcome Go(const data::TrialReadings& readings, const data::Rig& rig,
           const std::vector<KeptDistance>& distances = {}, const data::Tracks* other = nullptr,
           data::Tracks* all = nullptr) {
  Outcome out;
  ReconstructOptions options{.workers = 1};
  options.health.distances = distances;
  const data::Tracks tracks = Reconstruct(readings, rig, options, nullptr, false, &out.report);
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (!data::Usable(tracks.status[i])) continue;
    const SampleError error = ErrorOf(tracks, i, Three().truth()[i]);
    const auto k = static_cast<Eigen::Index>(i);
    out.moved.push_back(other == nullptr ? error.e.norm()
                                         : (tracks.p.col(k) - other->p.col(k)).norm());
    out.nees += error.Squared();
  }
  out.nees /= static_cast<double>(std::max<std::size_t>(1, out.moved.size()));
  if (all != nullptr) *all = tracks;
  return out;
}

TEST(Vouching, OfThreeCamerasNothingVouchesAndWhatAPixelDoesIsForetold) {
  Rng rng(5);
  const data::Rig rig = Three().DrawRig(&rng);
  Rng same = rng, again = rng;
  data::Tracks clean;
  const Outcome sound = Go(Three().Draw({}, kSigma, &same), rig, {}, nullptr, &clean);
  ASSERT_TRUE(sound.report.unvouched.any);
  EXPECT_THAT(Describe(sound.report.unvouched, rig.cameras.size() == 3
                                                   ? std::vector<std::string>{"a", "b", "c"}
                                                   : std::vector<std::string>{}),
              HasSubstr("nothing vouches for the cameras"));
  const int worst = sound.report.unvouched.camera;
  // The same noise, with that camera's sensor a pixel further: places move as was said.
  const Outcome bumped =
      Go(Three().Draw({.camera = worst, .px = 1.0, .from = -1.0}, kSigma, &again), rig, {}, &clean);
  EXPECT_NEAR(Median(bumped.moved) / sound.report.unvouched.metres_per_px, 1.0, 0.1);
  EXPECT_GT(Median(bumped.moved), 5.0 * sound.report.unvouched.stated);
}

TEST(Vouching, OfFourCamerasTheOthersVouch) {
  const HealthTrial four(4, 300);
  Rng rng(6);
  const data::Rig rig = four.DrawRig(&rng);
  HealthReport report;
  Reconstruct(four.Draw({}, kSigma, &rng), rig, {.workers = 1}, nullptr, false, &report);
  EXPECT_FALSE(report.unvouched.any);
  EXPECT_EQ(Describe(report.unvouched, {}), "");
}

TEST(Vouching, ErrorBarsAllowForShiftsWhereTheyAreAsked) {
  double with = 0.0, without = 0.0;
  constexpr int kDraws = 10;
  for (std::uint64_t draw = 0; draw < kDraws; ++draw) {
    Rng rng(70 + draw);
    data::Rig rig = Three().DrawRig(&rng);
    // Every camera by a draw of its own of 1 px.
    data::TrialReadings readings = Three().Draw({}, kSigma, &rng);
    for (std::size_t c = 0; c < 3; ++c) {
      const double shift = rng.Normal();
      for (std::size_t k = c; k < readings.u_px.size(); k += 3) readings.u_px[k] += shift;
    }
    without += Go(readings, rig).nees / kDraws;
    AllowForShifts(1.0, &rig);
    with += Go(readings, rig).nees / kDraws;
  }
  EXPECT_GT(without, 100.0);
  // A mean of ten draws of three numbers that all samples share: 30 degrees of freedom.
  EXPECT_LT(with, ChiSquareQuantile(0.999, 30) / 30.0);
  EXPECT_GT(with, ChiSquareQuantile(0.001, 30) / 30.0);
}

TEST(KeptDistances, SoundCamerasKeepThem) {
  for (std::uint64_t draw = 0; draw < 12; ++draw) {
    Rng rng(100 + draw);
    const data::Rig rig = Three().DrawRig(&rng);
    std::vector<KeptDistance> bar = TheBar();
    if (draw % 2 == 1) bar[0].length = bar[0].sigma = 0.0;
    const Outcome outcome = Go(Three().Draw({}, kSigma, &rng), rig, bar);
    const DistanceReport& found = outcome.report.distances;
    EXPECT_TRUE(found.kept) << Describe(found, bar, std::vector<std::string>{"a", "b", "c"});
    EXPECT_THAT(found.unknown, IsEmpty());
    ASSERT_EQ(found.each.size(), 1U);
    EXPECT_LT(std::abs(found.each[0].length - kLength), 4.0 * found.each[0].sigma);
    EXPECT_LT(found.each[0].scatter, 2.0 * found.each[0].expected);
  }
}

// A shift twice as large as is said to show, in each camera: it does, with its size.
TEST(KeptDistances, AShiftThatIsSaidToShowDoes) {
  const std::vector<std::string> names = {"a", "b", "c"};
  for (int camera = 0; camera < 3; ++camera) {
    Rng rng(200 + static_cast<std::uint64_t>(camera));
    const data::Rig rig = Three().DrawRig(&rng);
    Rng same = rng;
    const Outcome sound = Go(Three().Draw({}, kSigma, &same), rig, TheBar());
    const auto c = static_cast<std::size_t>(camera);
    ASSERT_EQ(sound.report.distances.shows_px.size(), 3U);
    const double px = 2.0 * sound.report.distances.shows_px[c];
    ASSERT_LT(px, 20.0);
    const Outcome outcome =
        Go(Three().Draw({.camera = camera, .px = px, .from = -1.0}, kSigma, &rng), rig, TheBar());
    const DistanceReport& found = outcome.report.distances;
    EXPECT_FALSE(found.kept) << camera;
    const auto its = std::find_if(found.causes.begin(), found.causes.end(), [&](const auto& one) {
      return one.cameras == std::vector<int>{camera} && one.lag == 0;
    });
    ASSERT_NE(its, found.causes.end()) << camera << Describe(found, TheBar(), names);
    EXPECT_NEAR(its->px, px, std::max(4.0 * its->sigma_px, 0.02 * px)) << camera;
  }
}

TEST(KeptDistances, LateAndExchangedCamerasAreNamed) {
  const std::vector<std::string> names = {"a", "b", "c"};
  for (const int lag : {-5, 1, 5}) {
    Rng rng(300 + static_cast<std::uint64_t>(lag + 5));
    const data::Rig rig = Three().DrawRig(&rng);
    const Outcome outcome =
        Go(Three().Draw({.camera = 1, .from = -1.0, .lag = lag}, kSigma, &rng), rig, TheBar());
    const DistanceReport& found = outcome.report.distances;
    EXPECT_FALSE(found.kept) << lag;
    EXPECT_THAT(Describe(found, TheBar(), names),
                HasSubstr(lag > 0 ? "camera b late by" : "camera b early by"))
        << lag;
  }
  for (int a = 0; a < 3; ++a) {
    for (int b = a + 1; b < 3; ++b) {
      Rng rng(400 + static_cast<std::uint64_t>(3 * a + b));
      const data::Rig rig = Three().DrawRig(&rng);
      data::TrialReadings readings = Three().Draw({}, kSigma, &rng);
      for (std::size_t i = 0; i < readings.size(); ++i) {
        std::swap(readings.u_px[3 * i + static_cast<std::size_t>(a)],
                  readings.u_px[3 * i + static_cast<std::size_t>(b)]);
      }
      const Outcome outcome = Go(readings, rig, TheBar());
      EXPECT_FALSE(outcome.report.distances.kept) << a << b;
      EXPECT_THAT(Describe(outcome.report.distances, TheBar(), names),
                  HasSubstr("cameras " + names[static_cast<std::size_t>(a)] + " and " +
                            names[static_cast<std::size_t>(b)] + " exchanged"));
    }
  }
}

// Marks that are on no rigid body, or exchanged in the table of slots.
TEST(KeptDistances, OtherMarksDoNotKeepThem) {
  Rng rng(9);
  const data::Rig rig = Three().DrawRig(&rng);
  const std::vector<KeptDistance> wrong = {{.a = "m0", .b = "m2"}};
  const Outcome outcome = Go(Three().Draw({}, kSigma, &rng), rig, wrong);
  EXPECT_FALSE(outcome.report.distances.kept);
  EXPECT_THAT(outcome.report.distances.causes, IsEmpty());
}

// What hides below what distances show is still said where it is more than error bars have.
TEST(KeptDistances, OfMarksThatHardlyMoveLittleIsSaid) {
  const HealthTrial::Way way = [](int mark, double t) -> Eigen::Vector3d {
    return {0.3 * mark, 0.1, 0.01 * std::sin(5.0 * t)};
  };
  const HealthTrial still(3, 400, 2160, way);
  Rng rng(10);
  const data::Rig rig = still.DrawRig(&rng);
  ReconstructOptions options{.workers = 1};
  options.health.distances = {{.a = "m0", .b = "m1"}};
  HealthReport report;
  Reconstruct(still.Draw({}, kSigma, &rng), rig, options, nullptr, false, &report);
  EXPECT_TRUE(report.distances.kept);
  EXPECT_TRUE(report.unvouched.any);
  EXPECT_GT(report.unvouched.hidden, report.unvouched.stated);
}

TEST(KeptDistances, WordsForThem) {
  const KeptDistance one = ParseKeptDistance("tip, tip_b = 0.32m+-0.1mm", "--rigid");
  EXPECT_EQ(one.a, "tip");
  EXPECT_EQ(one.b, "tip_b");
  EXPECT_DOUBLE_EQ(one.length, 0.32);
  EXPECT_DOUBLE_EQ(one.sigma, 1e-4);
  EXPECT_EQ(ParseKeptDistance("a,b", "--rigid").length, 0.0);
  for (const char* wrong : {"a", "a,a", "a,", "a,b,c", "a,b=", "a,b=0.3", "a,b=0.3m+-0",
                            "a,b=-1m+-1mm", "a,b=1mm+-1m"}) {
    EXPECT_THROW(ParseKeptDistance(wrong, "--rigid"), Error) << wrong;
  }
}

}  // namespace
}  // namespace unfurl::measure::vouching_test
