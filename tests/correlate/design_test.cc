// What a trial tells, and what a planned one would: against fits of the same thing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numeric>
#include <span>

#include "correlate/design/contributions.h"
#include "correlate/design/planned_trial.h"
#include "correlate/design/schedule.h"
#include "correlate/design/standard_errors.h"
#include "correlate/design/strobe.h"
#include "tests/correlate/instruments.h"
#include "tests/correlate/planned.h"
#include "tests/repeats.h"

namespace unfurl::correlate::design_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// --- The strobe's cycle

// Marks lit in turn, as `slots` says ("" is dark), from `first`, every line of `line` seconds.
Observations Strobed(const std::vector<std::string>& slots, double line, double first, int cycles) {
  Observations o;
  for (int k = 0; k < cycles * static_cast<int>(slots.size()); ++k) {
    const std::string& name = slots[static_cast<std::size_t>(k) % slots.size()];
    if (name.empty()) continue;
    int at = o.FindMark(name);
    if (at < 0) {
      at = static_cast<int>(o.marks.size());
      o.marks.push_back({});
      o.marks.back().name = name;
    }
    o.marks[static_cast<std::size_t>(at)].t.push_back(first + k * line);
  }
  return o;
}

TEST(Strobe, ACycleIsFoundFromStamps) {
  const Strobe s = FindStrobe(Strobed({"a", "b", "", "c"}, 1e-3, 17.25, 400));
  EXPECT_NEAR(s.line, 1e-3, 1e-9);
  EXPECT_THAT(s.slots, ElementsAre("a", "b", "", "c"));
  EXPECT_EQ(s.SlotAt(17.25), 0);
  EXPECT_EQ(s.SlotAt(17.25 + 7e-3), 3);
  EXPECT_EQ(s.SlotAt(17.25 - 1e-3), 3);
}

TEST(Strobe, AMarkMayBeLitTwiceAndLinesMayBeMissing) {
  Observations o = Strobed({"a", "b", "a", "c", ""}, 2e-4, 0.0, 300);
  // A mark hidden for a third of the record, another one here and there.
  auto& a = o.marks[0].t;
  a.erase(a.begin() + 200, a.begin() + 400);
  for (std::size_t i = 0; i < o.marks[1].t.size(); i += 3) o.marks[1].t[i] = 1e9;
  std::erase(o.marks[1].t, 1e9);
  const Strobe s = FindStrobe(o);
  EXPECT_NEAR(s.line, 2e-4, 1e-9);
  EXPECT_THAT(s.slots, ElementsAre("a", "b", "a", "c", ""));
}

TEST(Strobe, MarksSeenAtOnceHaveNone) {
  Observations o;
  for (const char* name : {"a", "b"}) {
    o.marks.push_back({});
    o.marks.back().name = name;
    for (int i = 0; i < 100; ++i) o.marks.back().t.push_back(0.01 * i);
  }
  const Strobe s = FindStrobe(o);
  EXPECT_EQ(s.line, 0.0);
  EXPECT_EQ(s.SlotAt(0.5), -1);
  EXPECT_THAT(s.why, HasSubstr("at the same time"));
}

TEST(Strobe, UnevenStampsHaveNone) {
  Observations o;
  Rng rng(3);
  for (const char* name : {"a", "b"}) {
    o.marks.push_back({});
    o.marks.back().name = name;
    for (int i = 0; i < 100; ++i) o.marks.back().t.push_back(i + rng.Uniform());
  }
  const Strobe s = FindStrobe(o);
  EXPECT_EQ(s.line, 0.0);
  EXPECT_FALSE(s.why.empty());
}

// --- The search for a cycle

// Marks of different worth, with less of it for each further line: the cheapest number of lines of
// each follows from a greedy choice, which is exact for concave sums.
double Worth(const std::vector<int>& cycle, const std::vector<double>& worth) {
  double sum = 0.0;
  for (std::size_t m = 0; m < worth.size(); ++m) {
    const auto n = std::count(cycle.begin(), cycle.end(), static_cast<int>(m));
    sum += worth[m] * std::sqrt(static_cast<double>(n));
  }
  return -sum;
}

double GreedyWorth(std::size_t lines, const std::vector<double>& worth) {
  std::vector<double> n(worth.size(), 0.0);
  for (std::size_t k = 0; k < lines; ++k) {
    std::size_t best = 0;
    auto gain = [&](std::size_t m) { return worth[m] * (std::sqrt(n[m] + 1.0) - std::sqrt(n[m])); };
    for (std::size_t m = 1; m < worth.size(); ++m) best = gain(m) > gain(best) ? m : best;
    n[best] += 1.0;
  }
  double sum = 0.0;
  for (std::size_t m = 0; m < worth.size(); ++m) sum += worth[m] * std::sqrt(n[m]);
  return -sum;
}

TEST(Schedule, TheBestOfAllAndByExchange) {
  const std::vector<double> worth = {1.0, 0.3, 2.0, 0.9};
  for (const std::size_t lines : {4U, 14U}) {  // 256 cycles, and 268 million
    ScheduleSearch search;
    search.marks = worth.size();
    for (std::size_t k = 0; k < lines; ++k) search.now.push_back(static_cast<int>(k % 4));
    search.now.push_back(-1);
    search.alike = 1e-9;
    search.cost = [&](const std::vector<int>& cycle) { return Worth(cycle, worth); };
    const std::vector<int> best = FindSchedule(search);
    EXPECT_EQ(best.back(), -1) << "the dark line stays";
    EXPECT_NEAR(Worth(best, worth), GreedyWorth(lines, worth), 1e-9) << lines;
  }
}

TEST(Schedule, MarksThatAreToBeKeptAndTheFewestChanges) {
  ScheduleSearch search;
  search.marks = 3;
  search.now = {0, 1, 2};
  search.cost = [&](const std::vector<int>& cycle) { return Worth(cycle, {1.0, 1e-3, 1e-3}); };
  EXPECT_THAT(FindSchedule(search), ElementsAre(0, 0, 0));
  search.kept = {2};
  EXPECT_THAT(FindSchedule(search), ElementsAre(0, 0, 2));
  search.alike = 1e9;
  EXPECT_THAT(FindSchedule(search), ElementsAre(0, 1, 2));
}

// --- What tells of parameters

TEST(Contributions, SharesAddUpAndLeavingOutIsWhatAFitWithoutSays) {
  Trial trial = TiltedTrial();
  trial.shared_rank = 2;
  trial.shared_size = 1e-4;
  const Fitted all(trial, 5, TwoLink::Marks());
  const Contributions c = ContributionsOf(all.problem, all.fit);
  ASSERT_EQ(c.series.size(), 4U);
  EXPECT_EQ(c.times.size(), 8U);
  for (std::size_t j = 0; j < 2; ++j) {
    double series = 0.0, times = 0.0;
    for (const Contribution& part : c.series) series += part.share[j];
    for (const Contribution& part : c.times) times += part.share[j];
    EXPECT_NEAR(series + c.priors[j], 1.0, 1e-9);
    EXPECT_NEAR(times + c.priors[j], 1.0, 1e-9);
    EXPECT_NEAR(c.sigma[j] / all.fit.parameters[j].sigma_white, 1.0, 0.02);
  }
  // The same record without a mark, fitted: its error grows as was said.
  for (const char* left_out : {"tip", "base"}) {
    Fitted without(trial, 5, TwoLink::Marks());
    std::erase_if(without.data.marks, [&](const MarkSeries& m) { return m.name == left_out; });
    without.Solve();
    for (const Contribution& part : c.series) {
      if (part.name != left_out) continue;
      for (std::size_t j = 0; j < 2; ++j) {
        const double grown = without.fit.parameters[j].sigma_white / c.sigma[j];
        EXPECT_NEAR(part.without[j], grown, 0.03 * grown) << left_out << " " << j;
      }
    }
  }
}

TEST(Contributions, CamerasShareASampleAsItsCovarianceSays) {
  // Five cameras with readings of unlike errors; covariances are what these make of a point.
  const double sigma[] = {1e-4, 2e-4, 1e-4, 5e-5, 1e9};  // the last one sees nothing [m]
  const Eigen::Vector3d sights[] = {{1, 0, 0.3}, {0, 1, 0.2}, {0.5, -0.4, 1}, {1, 1, 1}, {1, 0, 0}};
  Trial trial = TiltedTrial();
  trial.step = 0.02;
  Fitted f(trial, 8, TwoLink::Marks());
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (int c = 0; c < 5; ++c) {
    information += sights[c] * sights[c].transpose() / (sigma[c] * sigma[c]);
  }
  const Eigen::Matrix3d cov = information.inverse();
  for (MarkSeries& m : f.data.marks) {
    for (Eigen::Index i = 0; i < m.cov.cols(); ++i) {
      m.cov.col(i) << cov(0, 0), cov(0, 1), cov(0, 2), cov(1, 1), cov(1, 2), cov(2, 2);
    }
  }
  f.Solve();
  CameraSights cameras;
  cameras.names = {"A", "B", "C", "D", "E"};
  cameras.gradient = [&](std::size_t c, const Eigen::Vector3d&) { return sights[c]; };
  const Contributions c = ContributionsOf(f.problem, f.fit, 8, &cameras);
  ASSERT_EQ(c.cameras.size(), 5U);
  for (std::size_t j = 0; j < 2; ++j) {
    double sum = c.priors[j];
    for (const Contribution& camera : c.cameras) sum += camera.share[j];
    EXPECT_NEAR(sum, 1.0, 1e-6);
    EXPECT_GT(c.cameras[3].share[j], c.cameras[1].share[j]) << "the sharpest eye";
    EXPECT_NEAR(c.cameras[4].share[j], 0.0, 1e-9);
    EXPECT_NEAR(c.cameras[4].without[j], 1.0, 1e-6);
  }
}

TEST(StandardErrors, WhatNoRowTouchesIsNotDetermined) {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3, 3);
  H(0, 0) = 4.0;
  const StandardErrors e = StandardErrorsOf(H, 2);
  EXPECT_NEAR(e.sigma(0), 0.5, 1e-12);
  EXPECT_TRUE(std::isinf(e.sigma(1)));
  // Two that only their sum is known of.
  H.setZero(2, 2);
  H << 1.0, 1.0, 1.0, 1.0;
  EXPECT_TRUE(std::isinf(StandardErrorsOf(H, 2).sigma(0)));
}

TEST(StandardErrors, AnErrorThatTrialsShareDoesNotAverageAway) {
  // x + z by n readings of sigma s in each of two trials, z being 0 +- 1 and the same in both:
  // s^2 / 2n + 1. Were there one z to each: half of s^2 / n + 1.
  const double n = 25.0, s = 3.0;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3, 3), ties = Eigen::MatrixXd::Zero(3, 3);
  for (const Eigen::Index z : {1, 2}) {
    H(0, 0) += n / (s * s);
    H(0, z) = H(z, 0) = n / (s * s);
    H(z, z) = n / (s * s) + 1.0;
  }
  ties(1, 2) = ties(2, 1) = 1.0;
  EXPECT_NEAR(StandardErrorsOf(H, 1).sigma(0), std::sqrt(0.5 * (s * s / n + 1.0)), 1e-9);
  EXPECT_NEAR(StandardErrorsOf(H, 1, &ties).sigma(0), std::sqrt(0.5 * s * s / n + 1.0), 1e-9);
}

// --- Planned trials

TEST(PlannedTrial, ItsErrorsAreThoseOfAFitToSuchATrial) {
  Trial trial = TiltedTrial();
  trial.sigma = 1e-3;
  const Fitted at_hand(trial, 11, {"base", "elbow", "tip"});
  PlanBasis basis;
  basis.problem = &at_hand.problem;
  basis.fit = &at_hand.fit;
  basis.options = &at_hand.options;
  // "base2" was never recorded; lines four times as many as each mark has now.
  const PlannedContent content =
      ContentOf({"base", "base2", "elbow", "tip"}, trial, trial.step / 4.0, 4);
  const PlannedTrial plan(basis, at_hand.model, content);
  const Choice choices[] = {
      {{{0}, {}, {1}, {2, 3}}, {}}, {{{}, {0}, {1, 2, 3}, {}}, {}}, {{{0, 1}, {2}, {}, {3}}, {}}};
  for (const Choice& choice : std::span(choices).first(static_cast<std::size_t>(Repeats(1, 3)))) {
    const Eigen::VectorXd alone = PlannedErrors(basis, plan, choice, false);
    const Eigen::VectorXd together = PlannedErrors(basis, plan, choice, true);
    Rng rng(77);
    const Observations next = Recorded(content, choice, trial, rng);
    const FitResult one = FitTwoLink(at_hand.model, next, false);
    ASSERT_TRUE(one.Usable()) << one.message;
    FitProblem both = at_hand.problem;
    both.trials.push_back(both.trials[0]);
    both.trials[1].observations = &next;
    const FitResult two = Fit(both, at_hand.options);
    ASSERT_TRUE(two.Usable()) << two.message;
    for (Eigen::Index j = 0; j < 2; ++j) {
      const auto i = static_cast<std::size_t>(j);
      // Both are by differences, about two estimates that differ by their noise; a tenth is what is
      // asked of a prediction.
      EXPECT_NEAR(alone(j) / one.parameters[i].sigma_white, 1.0, 0.1) << j;
      EXPECT_NEAR(together(j) / two.parameters[i].sigma_white, 1.0, 0.1) << j;
    }
  }
}

TEST(PlannedTrial, WithATrialOfTheSameCalibrationAsAFitOfBoth) {
  Trial trial = TiltedTrial();
  trial.shared_rank = 2;
  trial.shared_size = 2e-5;  // as much as one trial's data leave open
  Fitted at_hand(trial, 21, {"base", "elbow", "tip"});
  at_hand.problem.trials[0].calibration = "rig";
  PlanBasis basis{&at_hand.problem, &at_hand.fit, &at_hand.options, 0};
  const PlannedContent content = ContentOf({"base", "elbow", "tip"}, trial, trial.step / 4.0, 4);
  const PlannedTrial plan(basis, at_hand.model, content);
  const Choice same{{{0}, {1}, {2}}, {}};
  const Eigen::VectorXd twice = PlannedErrors(basis, plan, same, true);
  // A fit of both.
  Rng rng(5);
  Observations next = Record(at_hand.model, TwoLink::Truth(), {"base", "elbow", "tip"}, trial, rng);
  FitProblem both = at_hand.problem;
  both.trials.push_back(both.trials[0]);
  both.trials[1].observations = &next;
  const FitResult fit = Fit(both, at_hand.options);
  ASSERT_TRUE(fit.Usable()) << fit.message;
  for (Eigen::Index j = 0; j < 2; ++j) {
    EXPECT_NEAR(twice(j) / fit.parameters[static_cast<std::size_t>(j)].sigma_data, 1.0, 0.1);
  }
}

TEST(PlannedTrial, InstrumentsCountAsTheirFitSays) {
  // A gyroscope of unknown bias beside the marks, and a switch at each passing.
  const Instrumented model;
  Trial trial = TiltedTrial();
  trial.sigma = 1e-3;
  Rng rng(31);
  const Observations data = Record(model, TwoLink::Truth(), {"base", "elbow", "tip"}, trial, rng);
  FitProblem problem;
  problem.parameters = TwoLinkParameters();
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.trials[0].observations = &data;
  FitOptions options;
  options.profile.wanted = false;
  const FitResult fit = Fit(problem, options);
  ASSERT_TRUE(fit.Usable());
  const PlanBasis basis{&problem, &fit, &options, 0};

  PlannedContent content;
  for (const MarkSeries& m : data.marks) {
    content.marks.push_back({m.name, m.t, std::vector<int>(m.size(), 0)});
  }
  Instrument gyro;
  gyro.quantity = "first.rate";
  gyro.sigma = 0.003;
  ChannelRecord record = Read(gyro, trial.offset, rng);
  record.bias = Prior::Free();
  content.channels = {record};
  const PlannedTrial plan(basis, model, content);
  const Choice marks{{{0}, {0}, {0}}, {false}}, all{{{0}, {0}, {0}}, {true}};
  const Eigen::VectorXd without = PlannedErrors(basis, plan, marks, false);
  const Eigen::VectorXd with = PlannedErrors(basis, plan, all, false);

  Observations beside = data;
  beside.others = {std::make_shared<Channel>(record)};
  const FitResult both = FitTwoLink(model, beside, false);
  ASSERT_TRUE(both.Usable());
  for (Eigen::Index j = 0; j < 2; ++j) {
    const auto i = static_cast<std::size_t>(j);
    EXPECT_NEAR(without(j) / fit.parameters[i].sigma_white, 1.0, 0.05);
    EXPECT_NEAR(with(j) / both.parameters[i].sigma_white, 1.0, 0.05);
    EXPECT_LT(with(j), 0.95 * without(j));
  }
}

}  // namespace
}  // namespace unfurl::correlate::design_test
