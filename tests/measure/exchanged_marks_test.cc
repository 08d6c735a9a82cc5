#include "measure/exchanged_marks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "base/random.h"
#include "measure/reconstruct.h"
#include "tests/measure/health_trial.h"

namespace unfurl::measure::exchanged_marks_test {
namespace {

using testing::ContainsRegex;
using testing::HasSubstr;

constexpr double kInterval = 0.005;  // [s]
constexpr double kSigma = 5e-5;      // of a place [m]

using Way = std::function<Eigen::Vector3d(int, double)>;

Eigen::Vector3d Swing(int mark, double t) {
  const double m = mark, rate = 3.0 - 0.4 * m;
  return {0.3 * m + 0.2 * std::sin(rate * t + m), 0.3 * std::cos(rate * t + m),
          0.05 * m + 0.002 * std::sin(60.0 * t)};
}

// Marks in turn, named by `names` (line, mark) and unseen where it says -1.
std::vector<ExchangedMark> Watch(int marks, const Way& way,
                                 const std::function<int(double, int)>& names, Rng* rng,
                                 double until = 2.0) {
  ExchangeWatch watch(static_cast<std::size_t>(marks));
  for (double t = 0.0; t < until; t += kInterval) {
    for (int m = 0; m < marks; ++m) {
      const double at = t + kInterval * m / (marks + 1.0);
      const int name = names(at, m);
      Eigen::Vector3d p = way(m, at);
      for (double& x : p) x += kSigma / std::sqrt(3.0) * rng->Normal();
      if (name >= 0) watch.Add(at, name, p, kSigma);
    }
  }
  return watch.found();
}

TEST(ExchangeWatch, MarksThatChangeTheirNamesAreFound) {
  for (const double gap : {0.0, 0.03, 0.06}) {  // in which neither is found
    Rng rng(1);
    const auto found = Watch(
        4, Swing,
        [&](double t, int m) {
          if (t < 1.0 || m == 0 || m == 3) return m;
          return t < 1.0 + gap ? -1 : 3 - m;
        },
        &rng);
    ASSERT_EQ(found.size(), 2U) << gap;
    std::map<int, int> was;
    for (const ExchangedMark& one : found) {
      was[one.mark] = one.was;
      EXPECT_NEAR(one.from, 1.0 + gap, 1.5 * kInterval);
      EXPECT_NEAR(one.after, 1.0, 1.5 * kInterval);
    }
    EXPECT_EQ(was, (std::map<int, int>{{1, 2}, {2, 1}}));
  }
}

TEST(ExchangeWatch, SoAreThreeInARing) {
  Rng rng(2);
  const auto found = Watch(
      4, Swing, [](double t, int m) { return t < 1.0 || m == 3 ? m : (m + 1) % 3; }, &rng);
  ASSERT_EQ(found.size(), 3U);
  for (const ExchangedMark& one : found) EXPECT_EQ(one.mark, (one.was + 1) % 3);
}

// All marks are kicked at random moments, all at once, as hard as to turn back; gaps besides.
TEST(ExchangeWatch, KicksAndGapsAreNoExchange) {
  std::size_t found = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    Rng rng(seed);
    std::vector<Eigen::Vector3d> before(4), after(4), place(4);
    for (int m = 0; m < 4; ++m) {
      for (auto* v : {&before[static_cast<std::size_t>(m)], &after[static_cast<std::size_t>(m)],
                      &place[static_cast<std::size_t>(m)]}) {
        for (double& x : *v) x = rng.Normal();
      }
      place[static_cast<std::size_t>(m)] *= 0.2;
    }
    const double kick = 0.4 + 0.01 * static_cast<double>(seed % 7), gap = 0.005 * (seed % 10);
    const auto way = [&](int mark, double t) -> Eigen::Vector3d {
      const auto m = static_cast<std::size_t>(mark);
      return place[m] + (t - kick) * (t < kick ? before[m] : after[m]);
    };
    found +=
        Watch(
            4, way,
            [&](double t, int m) { return t > kick - 0.5 * gap && t < kick + 0.5 * gap ? -1 : m; },
            &rng, 0.8)
            .size();
  }
  EXPECT_EQ(found, 0U);
}

// They meet and exchange their velocities, as equal balls do.
TEST(ExchangeWatch, ABounceIsNoExchange) {
  for (const double offset : {0.0, 0.002, 0.004}) {
    Rng rng(4);
    const auto way = [&](int m, double t) -> Eigen::Vector3d {
      const double side = m == 0 ? -1.0 : 1.0;
      return {side * (0.005 + std::abs(t - 0.5 - offset)), 0.0, 0.0};
    };
    EXPECT_TRUE(Watch(
                    2, way, [](double, int m) { return m; }, &rng, 1.0)
                    .empty())
        << offset;
  }
}

// The LED of one mark is lit in the slot of another, too, for some time or to the end.
TEST(ExchangeWatch, OneLedInTwoSlotsIsFound) {
  for (const double gap : {0.0, 0.03}) {  // in which neither is found
    for (const double until : {1.2, 3.0}) {
      const Way way = [&](int m, double t) {
        return Swing(m == 1 && t > 1.0 + gap && t < until ? 2 : m, t);
      };
      Rng rng(5);
      const auto names = [&](double t, int m) {
        return m == 1 && t > 1.0 && t < 1.0 + gap ? -1 : m;
      };
      const auto found = Watch(4, way, names, &rng);
      ASSERT_EQ(found.size(), 1U) << gap;
      EXPECT_TRUE(found[0].both);
      EXPECT_EQ(std::pair(found[0].mark, found[0].was), std::pair(1, 2));
      EXPECT_NEAR(found[0].after, 1.0, 1.5 * kInterval);
      EXPECT_NEAR(found[0].from, 1.0 + gap, 1.5 * kInterval);
      EXPECT_THAT(Describe(found, std::vector<std::string>{"a", "b", "c", "d"}),
                  ContainsRegex("s on where c is, to [0-9.]+ mm, as two LEDs cannot be"));
    }
  }
}

TEST(ExchangeWatch, SoIsOneThatIsInBothSlotsFromTheFirstFlashOn) {
  Rng rng(6);
  const auto found = Watch(
      4, [](int m, double t) { return Swing(m == 3 ? 0 : m, t); }, [](double, int m) { return m; },
      &rng);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_THAT(Describe(found, std::vector<std::string>{"a", "b", "c", "d"}),
              HasSubstr("from the first flash on"));
}

// Two on one body, as near to each other as a place of them is known; a mark that jumps to half
// a millimetre beside another and goes with it; and two that pass through each other.
TEST(ExchangeWatch, MarksThatAreNearEachOtherAreTwo) {
  const auto same = [](double, int m) { return m; };
  for (const double apart : {1.0, 2.0, 4.0}) {
    Rng rng(7);
    const Eigen::Vector3d off = Eigen::Vector3d(0.6, 0.0, 0.8) * kSigma * apart;
    const Way body = [&](int m, double t) -> Eigen::Vector3d { return Swing(0, t) + m * off; };
    EXPECT_TRUE(Watch(2, body, same, &rng).empty()) << apart;
  }
  Rng rng(8);
  const Way beside = [](int m, double t) -> Eigen::Vector3d {
    return m == 1 && t > 1.0 ? Swing(2, t) + Eigen::Vector3d(5e-4, 0.0, 0.0) : Swing(m, t);
  };
  EXPECT_TRUE(Watch(3, beside, same, &rng).empty());
  const Way through = [](int m, double t) -> Eigen::Vector3d {
    return {(m == 0 ? 0.4 : -0.4) * (t - 1.0), 0.1 * std::sin(t), 0.0};
  };
  EXPECT_TRUE(Watch(2, through, same, &rng).empty());
}

// Through the whole reconstruction, of readings whose slots are exchanged half-way.
TEST(Reconstruct, SlotsThatAreExchangedHalfWayAreNamed) {
  const HealthTrial::Way way = [](int m, double t) -> Eigen::Vector3d {
    return {-0.5 + 0.32 * m, 0.2 * std::sin(2.0 * t + m), 0.1 * std::cos(1.5 * t)};
  };
  const HealthTrial trial(4, 3000, 2160, way);
  Rng rng(7);
  const data::Rig rig = trial.DrawRig(&rng);
  data::TrialReadings readings = trial.Draw({}, 0.03, &rng);
  for (const bool exchanged : {false, true}) {
    if (exchanged) {
      int a = -1, b = -1;
      for (std::size_t s = 0; s < readings.slots.size(); ++s) {
        if (readings.slots[s] == "m0") a = static_cast<int>(s);
        if (readings.slots[s] == "m1") b = static_cast<int>(s);
      }
      ASSERT_GE(std::min(a, b), 0);
      for (std::size_t i = readings.size() / 2; i < readings.size(); ++i) {
        if (readings.slot[i] == a || readings.slot[i] == b) {
          readings.slot[i] = a + b - readings.slot[i];
        }
      }
    }
    ReconstructOptions options{.workers = 1};
    options.health.distances = {{.a = "m0", .b = "m2"}};
    ReconstructSummary summary;
    HealthReport report;
    Reconstruct(readings, rig, options, &summary, false, &report);
    if (!exchanged) {
      EXPECT_TRUE(summary.exchanged.empty());
      continue;
    }
    ASSERT_EQ(summary.exchanged.size(), 2U);
    EXPECT_THAT(Describe(summary.exchanged, summary.marks), HasSubstr("where m1 was at"));
    EXPECT_THAT(Describe(summary.exchanged, summary.marks), HasSubstr("where m0 was at"));
    // No delay of a camera by some rounds, which leaves no places to be kept, is the cause.
    EXPECT_FALSE(report.distances.kept);
    EXPECT_TRUE(report.distances.causes.empty());
  }
}

}  // namespace
}  // namespace unfurl::measure::exchanged_marks_test
