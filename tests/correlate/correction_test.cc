// What a fine model differs by from a coarse one, learnt at points and applied between them.
#include "correlate/fit/correction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "base/random.h"
#include "correlate/residual/timed_events.h"
#include "tests/correlate/fit_repeats.h"
#include "tests/correlate/two_link.h"

namespace unfurl::correlate::correction_test {
namespace {

// The correction is exact where it was taken and where it has learnt, in marks and in event times.
TEST(Correction, IsExactAtItsPoints) {
  const TwoLink model;
  Rng rng(11);
  Observations data = Record(model, TwoLink::Truth(), TwoLink::Marks(), SparseTrial(), rng);
  data.others = {
      std::make_shared<TimedEvents>(std::vector<TimedEvent>{{"latch", "a", 2, 1.0, 1e-3}})};
  const std::vector<Parameter> parameters = TwoLinkParameters();
  const Stamps stamps = data.StampsAt(data.Start());
  auto at = [&](double frequency, double latch) {
    Prediction p = model.Evaluate(std::vector<double>{frequency, 0.35}, stamps);
    p.events = {{0.1, "latch", "a"}, {latch, "latch", "a"}};
    return p;
  };
  auto u = [&](double frequency) { return Eigen::VectorXd{{frequency, std::log(0.35)}}; };
  const std::vector<const Observations*> observations = {&data};
  Correction correction(parameters, observations, u(0.9),
                        {Correction::DifferenceOf(data, at(0.90, 0.50), at(0.91, 0.53))});
  correction.Learn(u(0.92), {Correction::DifferenceOf(data, at(0.92, 0.60), at(0.94, 0.68))},
                   Eigen::Vector2d(1e-3, 1e-2));
  const Prediction first = correction.Apply(0, {0.90, 0.35}, at(0.90, 0.50));
  const Prediction second = correction.Apply(0, {0.92, 0.35}, at(0.92, 0.60));
  for (std::size_t m = 0; m < 4; ++m) {
    EXPECT_LT((first.marks[m].p - at(0.91, 0.0).marks[m].p).norm(), 1e-12);
    EXPECT_LT((second.marks[m].p - at(0.94, 0.0).marks[m].p).norm(), 1e-12);
    EXPECT_LT((second.marks[m].v - at(0.94, 0.0).marks[m].v).norm(), 1e-9);
  }
  EXPECT_EQ(first.events[0].t, 0.1);
  EXPECT_NEAR(first.events[1].t, 0.53, 1e-12);
  EXPECT_NEAR(second.events[1].t, 0.68, 1e-12);
}

// What a law adds goes with its amount: learnt at two amounts it is right at any, and stays right
// when the centre moves, though the solver's coordinate is the logarithm.
TEST(Correction, GoesWithTheValueOfALogarithm) {
  const TwoLink model;
  Rng rng(12);
  const Observations data = Record(model, TwoLink::Truth(), TwoLink::Marks(), SparseTrial(), rng);
  const std::vector<Parameter> parameters = TwoLinkParameters();
  ASSERT_TRUE(parameters[1].log);
  const Prediction coarse =
      model.Evaluate(std::vector<double>{0.9, 0.35}, data.StampsAt(data.Start()));
  auto fine = [&](double amount) {
    Prediction p = coarse;
    for (MarkMotion& mark : p.marks) mark.p.array() += 0.01 * amount;
    return p;
  };
  auto u = [](double amount) { return Eigen::VectorXd{{0.9, std::log(amount)}}; };
  auto difference = [&](double amount) {
    return Correction::Difference{Correction::DifferenceOf(data, coarse, fine(amount))};
  };
  Correction correction(parameters, {&data}, u(1.0), difference(1.0));
  correction.Learn(u(0.4), difference(0.4), Eigen::Vector2d(1e-3, 0.5));
  for (int moved = 0; moved < 2; ++moved) {
    for (const double amount : {2.0, 0.1, 1e-4}) {
      const Prediction out = correction.Apply(0, {0.9, amount}, coarse);
      EXPECT_LT((out.marks[0].p - fine(amount).marks[0].p).cwiseAbs().maxCoeff(), 1e-12)
          << amount << " " << moved;
    }
    correction.MoveTo(u(0.4), difference(0.4));
  }
}

}  // namespace
}  // namespace unfurl::correlate::correction_test
