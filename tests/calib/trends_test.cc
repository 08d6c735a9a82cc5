// Models that are wrong, with rays through glass: readings that drift, patterns that no lens term
// makes, surveys confined to a corner, stations that sink or that were moved, noise that is larger
// than stated. A verdict "good" is only given where error bars hold.
#include "calib/trends.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <string>
#include <vector>

#include "base/worker_pool.h"
#include "calib/calibrate.h"
#include "calib/unseen_drift.h"
#include "calib/verdict.h"
#include "tests/calib/faulty_lab.h"
#include "tests/calib/traced.h"
#include "tests/repeats.h"

namespace unfurl::calib::trends_test {
namespace {

using ::testing::Contains;
using testing::Fault;
using ::testing::HasSubstr;
using testing::NameOf;
using testing::TracedLab;

// UNFURL_LABS of them, from number UNFURL_LABS_FROM on: a study goes on where another ended.
std::size_t FromEnvironment(const char* name, std::size_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : static_cast<std::size_t>(std::atoi(text));
}
const std::size_t kLabs = FromEnvironment("UNFURL_LABS", testing::Labs(2, 300));
// The few that are always run hold some that are good.
const std::size_t kFrom = FromEnvironment("UNFURL_LABS_FROM", testing::Labs(17, 0));
// Of the kinds below this one alone; 0: in turn.
const std::size_t kOnly = FromEnvironment("UNFURL_LABS_FAULT", 0);
// Cores: 0, all; and whether faultless surveys are measured along their places.
const std::size_t kWorkers = FromEnvironment("UNFURL_LABS_WORKERS", 0);
const std::size_t kAlong = FromEnvironment("UNFURL_LABS_ALONG", 0);
constexpr int kPoints = testing::FaultyLab::kPoints;

// One laboratory with a fault, and what became of it.
struct Outcome {
  Fault fault = Fault::kNone;
  std::string verdict;
  double nees = 0.0;  // of truth that was held out, over 3
  bool trend = false;
};

std::vector<Outcome> RunLabs(std::uint64_t first, bool faulty) {
  std::vector<Outcome> out(kLabs);
  ParallelFor(kLabs, kWorkers, [&](std::size_t k) {
    const std::size_t number = kFrom + k;
    const auto fault = static_cast<Fault>(!faulty     ? 0
                                          : kOnly > 0 ? kOnly
                                                      : 1 + number % testing::kFaults);
    testing::FaultyLab lab(first + number, fault);
    if (!faulty && kAlong > 0) lab.MeasureAlong();
    const Calibration result = Calibrate(lab.Survey(), {.workers = 1}, "test");
    out[k] = {fault, result.rig.verdict, lab.NeesOf(result.rig)};
    // Of one that would not show nothing was seen, and it has no chance.
    for (const Trend& trend : result.report.trends) {
      out[k].trend |= trend.found && trend.chance < 1.0;
    }
    std::printf("%4zu %-11s %-17s NEES/3 %7.2f  %s: %s\n", number, NameOf(fault),
                result.rig.verdict.c_str(), out[k].nees, lab.Words().c_str(),
                result.rig.reasons.front().c_str());
    std::fflush(stdout);  // a study that is stopped has told what it knows
  });
  return out;
}

// A row for each kind: the verdicts, and of those that are good the mean of NEES/3. One laboratory
// has some 24 to 100 independent errors, so that a sound one alone may be above 1.3.
struct Row {
  int labs = 0, good = 0, care = 0, no = 0, above = 0;
  double sum = 0.0, worst = 0.0;

  double Mean() const { return good > 0 ? sum / good : 0.0; }
};

Row TableOf(const std::vector<Outcome>& outcomes) {
  std::vector<Row> rows(testing::kFaults + 1);
  Row all;
  for (const Outcome& one : outcomes) {
    for (Row* row : {&rows[static_cast<std::size_t>(one.fault)], &all}) {
      ++row->labs;
      (one.verdict == kGood ? row->good : one.verdict == kWithCare ? row->care : row->no) += 1;
      if (one.verdict != kGood) continue;
      row->sum += one.nees;
      row->worst = std::max(row->worst, one.nees);
      row->above += one.nees > 1.3 ? 1 : 0;
    }
  }
  std::printf("%-12s labs good care  no  NEES/3 of the good: mean, above 1.3, largest\n", "");
  for (std::size_t k = 0; k <= rows.size(); ++k) {
    const Row& row = k < rows.size() ? rows[k] : all;
    if (row.labs == 0) continue;
    std::printf("%-12s %4d %4d %4d %3d  %5.2f %3d %5.2f\n",
                k < rows.size() ? NameOf(static_cast<Fault>(k)) : "all", row.labs, row.good,
                row.care, row.no, row.Mean(), row.above, row.worst);
  }
  return all;
}

TEST(TrendsTraced, GoodMeansThatErrorBarsHold) {
  const Row all = TableOf(RunLabs(500, true));
  EXPECT_LE(all.Mean(), 1.3);
  EXPECT_GE(all.good, 1) << "nothing was tested";
}

// With three cameras none is good, fault or not; what is asked is that no trend is seen.
TEST(TrendsTraced, FaultlessLaboratoriesAreLeftAlone) {
  const std::vector<Outcome> labs = RunLabs(9000, false);
  TableOf(labs);
  const auto seen =
      std::count_if(labs.begin(), labs.end(), [](const Outcome& o) { return o.trend; });
  std::printf("a trend in %ld\n", static_cast<long>(seen));
  EXPECT_LE(seen, std::max(1.0, 0.03 * static_cast<double>(kLabs)));
}

#ifndef UNFURL_SLOW_TESTS

// One pixel over the survey: named, taken out, and the error is as without it.
TEST(Trends, ADriftIsNamedAndTakenOut) {
  TracedLab lab(21);
  Observations data = lab.Survey(kPoints);
  const data::Rig clean = FitRig(data, {}, "test").rig;
  for (Reading& r : data.readings) {
    if (r.camera == 2) r.u_px += (r.point + 0.5) / kPoints - 1.0;
  }
  const Calibration result = Calibrate(data, {}, "test");
  EXPECT_EQ(result.rig.verdict, kWithCare);
  EXPECT_THAT(result.rig.reasons, Contains(HasSubstr("drift over the survey")));
  int found = 0;
  for (const Trend& trend : result.report.trends) {
    if (!trend.found) continue;
    ++found;
    EXPECT_TRUE(trend.kind == TrendKind::kReadingDrift && trend.camera == 2) << trend.text;
    EXPECT_NEAR(trend.change, 1.0, 0.1);
  }
  EXPECT_EQ(found, 1);
  const testing::TracedErrors with = FindCheckPoints(lab, result.rig, 150);
  EXPECT_LT(with.Squares(), 2.0 * FindCheckPoints(lab, clean, 150).Squares());
  EXPECT_LT(with.Squares(), 2.0 * with.Bounds());
}

// Ripples of a tenth of the row that no lens makes, beside a survey that is as precise: the point
// errors that they make are beyond the stated ones.
TEST(Trends, APatternThatHarmsIsNotGood) {
  TracedLab lab(22);
  lab.survey_sigma = 3e-5;
  Observations data = lab.Survey(kPoints);
  for (Reading& r : data.readings) r.u_px += 0.2 * std::sin(2.0 * M_PI * r.u_px / 300.0);
  const Calibration result = Calibrate(data, {}, "test");
  EXPECT_NE(result.rig.verdict, kGood);
  EXPECT_THAT(result.rig.reasons, Contains(HasSubstr("follow a pattern")));
}

// Ripples that precise readings show and that no found point does, as the survey's error is far
// larger: said, and no reason to mistrust the rig.
TEST(Trends, APatternThatHarmsNoPointIsSaid) {
  TracedLab lab(22);
  lab.reading_sigma = 0.005;
  Observations data = lab.Survey(kPoints);
  for (Reading& r : data.readings) {
    if (r.camera == 1) r.u_px += 0.015 * std::sin(2.0 * M_PI * r.u_px / 216.0);
  }
  const Calibration result = Calibrate(data, {}, "test");
  EXPECT_EQ(result.rig.verdict, kGood);
  EXPECT_THAT(result.rig.reasons, Contains(HasSubstr("it raises squared errors")));
  // The same pattern is named where it is asked for.
  CalibrateOptions strict;
  strict.trends.harmless = 0.0;
  EXPECT_EQ(Calibrate(data, strict, "test").rig.verdict, kWithCare);
}

// The station's tripod sinks by 3 mm while the survey goes on.
TEST(Trends, AStationThatSinksIsSeen) {
  TracedLab lab(23);
  Observations data = lab.Survey(kPoints);
  for (Eigen::Index i = 0; i < data.p.cols(); ++i) {
    data.p(2, i) += 3e-3 * static_cast<double>(i) / kPoints;
  }
  const Calibration result = Calibrate(data, {}, "test");
  EXPECT_NE(result.rig.verdict, kGood);
  EXPECT_THAT(result.rig.reasons, Contains(HasSubstr("surveyed places drift")));
}

// By what share the most harmful drift that may as well be missed raises squared errors.
double RiseOfUnseen(const Observations& data) {
  const RigFit fit = FitRig(data, {}, "test");
  double out = 0.0;
  for (const Trend& trend : FindUnseenDrift(data, fit.priors, fit.bundle)) {
    out = std::max(out, trend.rise);
  }
  return out;
}

// Points in the order of x: what the tripod sinks by is a shear, which cameras take for their own
// places. No residual shows it (of 10 mm either), and the verdict is silent only where somebody
// says that nothing moved.
TEST(Trends, AnOrderThatGoesWithPlaceIsNotGood) {
  TracedLab lab(23);
  Eigen::Matrix3Xd places = lab.Places(kPoints);
  std::vector<Eigen::Index> order(kPoints);
  std::iota(order.begin(), order.end(), Eigen::Index{0});
  std::sort(order.begin(), order.end(),
            [&](Eigen::Index a, Eigen::Index b) { return places(0, a) < places(0, b); });
  Observations data = lab.Survey(places(Eigen::all, order));
  for (Eigen::Index i = 0; i < data.p.cols(); ++i) {
    data.p(2, i) += 3e-3 * static_cast<double>(i) / kPoints;
  }
  const Calibration result = Calibrate(data, {}, "test");
  EXPECT_EQ(result.rig.verdict, kWithCare);
  EXPECT_THAT(result.rig.reasons, Contains(HasSubstr("an order that goes with their place")));
  CalibrateOptions steady;
  steady.trends.steady = true;
  EXPECT_EQ(Calibrate(data, steady, "test").rig.verdict, kGood);
  // On the way there and back the same points show it.
  std::vector<int> back;
  for (int i = 0; i < kPoints; i += 2) back.push_back(i);
  for (int i = kPoints - 1; i > 0; i -= 2) back.push_back(i);
  Observations both = lab.Survey(Eigen::Matrix3Xd(places(Eigen::all, order))(Eigen::all, back));
  EXPECT_EQ(Calibrate(both, {}, "test").rig.verdict, kGood);
  const double along = RiseOfUnseen(data), there_and_back = RiseOfUnseen(both),
               any = RiseOfUnseen(lab.Survey(places));
  std::printf("unseen along x %.3g, there and back %.3g, in any order %.3g\n", along,
              there_and_back, any);
  // Most of a shear is missed whatever its size: no limit of some tenths is near.
  EXPECT_GT(along, 10.0 * TrendOptions().unseen);
  for (Eigen::Index i = 0; i < both.p.cols(); ++i) {
    both.p(2, i) += 3e-3 * static_cast<double>(i) / kPoints;
  }
  EXPECT_THAT(Calibrate(both, {}, "test").rig.reasons,
              Contains(HasSubstr("surveyed places drift")));
}

// Points on three walls, each at a place of its own by the station: noise alone decides which of a
// wall's are nearer, and that is no second set-up.
TEST(Trends, ThreeWallsAreNoSetUps) {
  for (const std::uint64_t seed : {26, 27}) {
    TracedLab lab(seed);
    Eigen::Matrix3Xd places = lab.Places(kPoints);
    for (int i = 0; i < kPoints; ++i) places(i % 3, i) = -testing::kTracedHalf;
    for (const Trend& trend : Calibrate(lab.Survey(places), {}, "test").report.trends) {
      EXPECT_FALSE(trend.found) << trend.text;
    }
  }
}

// A second set-up that is off by 4 sigmas of a point: most of it is one affine map, which no
// residual shows; what is not makes the survey scatter more than it states.
TEST(Trends, ASetUpThatIsOffIsNotGood) {
  TracedLab lab(25);
  Observations data = lab.Survey(kPoints);
  for (Eigen::Index i = 0; i < data.p.cols(); ++i) {
    if (data.p.col(i).sum() > 0.0) data.p.col(i).array() += 4.0 / std::sqrt(3.0) * lab.survey_sigma;
  }
  EXPECT_NE(Calibrate(data, {}, "test").rig.verdict, kGood);
}

TEST(Trends, ASurveyInACornerIsNotGood) {
  TracedLab lab(24);
  // Bundles of much that is left open take long.
  Eigen::Matrix3Xd places = 0.3 * lab.Places(Repeats(60, kPoints));
  places.colwise() += 0.7 * Eigen::Vector3d(1.0, -1.0, 1.0);
  const Calibration result = Calibrate(lab.Survey(places), {}, "test");
  EXPECT_NE(result.rig.verdict, kGood);
  EXPECT_THAT(result.rig.reasons, Contains(HasSubstr("of the rows")));
}

#else

// A camera that drifts by what FindUnseenDrift says is found with even odds: in 40 draws.
TEST(Trends, WhatIsFoundWithEvenOdds) {
  constexpr std::size_t kDraws = 40;
  std::vector<int> found(kDraws, 0);
  double most = 0.0;
  ParallelFor(kDraws, kWorkers, [&](std::size_t k) {
    TracedLab lab(21);
    lab.rng = Rng(3000 + k);
    Observations data = lab.Survey(kPoints);
    const RigFit fit = FitRig(data, {}, "test");
    const std::vector<Trend> unseen = FindUnseenDrift(data, fit.priors, fit.bundle);
    const double change = unseen[1 + 2].change;
    if (k == 0) most = unseen[1 + 2].rise;
    for (Reading& r : data.readings) {
      if (r.camera == 2) r.u_px += change * (r.point + 0.5) / kPoints;
    }
    const RigFit drifts = FitRig(data, {}, "test");
    for (const Trend& trend : TestTrends(data, drifts.priors, drifts.bundle).trends) {
      found[k] |= trend.found && trend.kind == TrendKind::kReadingDrift ? 1 : 0;
    }
  });
  const double share = static_cast<double>(std::accumulate(found.begin(), found.end(), 0)) / kDraws;
  std::printf("found %.0f%%; rise %.3f\n", 100.0 * share, most);
  // The test spreads over half waves beside the line: somewhat less than even.
  EXPECT_NEAR(share, 0.5, 0.25);
}

#endif  // UNFURL_SLOW_TESTS

}  // namespace
}  // namespace unfurl::calib::trends_test
