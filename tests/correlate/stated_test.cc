// What is stated beforehand held against the data: against algebra of two normal densities written
// out, in an alignment and in a fit.
#include "correlate/align/stated.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "base/statistics.h"
#include "correlate/compare/clock_words.h"
#include "correlate/fit/goodness.h"
#include "correlate/fit/normal_matrix.h"
#include "tests/correlate/instruments.h"

namespace unfurl::correlate::stated_test {
namespace {

// A number that `n` readings of unit noise tell, and a density says beforehand.
struct OneNumber {
  int n = 40;
  double mean = 0.0, sigma = 1.0;

  Stated Hold(const Eigen::VectorXd& readings) const {
    Eigen::MatrixXd A = Eigen::MatrixXd::Constant(n + 1, 1, -1.0);
    A(n, 0) = 1.0 / sigma;
    const double information = n + 1.0 / (sigma * sigma);
    const double value = (readings.sum() + mean / (sigma * sigma)) / information;
    Eigen::VectorXd residual(n + 1);
    residual << readings.array() - value, (value - mean) / sigma;
    std::vector<Stated> stated(1);
    stated[0].row = n, stated[0].mean = mean, stated[0].sigma = sigma, stated[0].value = value;
    const Eigen::MatrixXd inverse = Eigen::MatrixXd::Constant(1, 1, 1.0 / information);
    HoldAgainstData(A, residual, inverse, inverse, 0.0, &stated);
    return stated[0];
  }
};

TEST(Stated, IsHeldAgainstWhatTheDataSayWithoutIt) {
  for (const double sigma : {0.01, 0.1, 1.0, 10.0}) {
    Rng rng(1);
    const OneNumber of{40, 0.7, sigma};
    Eigen::VectorXd readings(of.n);
    for (double& y : readings) y = 0.3 + rng.Normal();
    const double alone = readings.mean(), variance = sigma * sigma + 1.0 / of.n;
    const Stated s = of.Hold(readings);
    const double off = (alone - of.mean) * (alone - of.mean) / variance;
    EXPECT_NEAR(s.p_value, ChiSquareTail(off, 1.0), 1e-6) << sigma;
    EXPECT_NEAR(s.without, alone, 1e-6) << sigma;
    EXPECT_NEAR(s.value + s.shift(0), alone, 1e-6) << sigma;
  }
}

TEST(Stated, ATrueOneIsContradictedByChanceAlone) {
  constexpr int kSeeds = 4000;
  for (const double sigma : {0.03, 0.16, 1.0}) {
    std::size_t contradicted = 0;
    for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
      Rng rng(seed);
      const OneNumber of{40, sigma * rng.Normal(), sigma};
      Eigen::VectorXd readings(of.n);
      for (double& y : readings) y = rng.Normal();
      contradicted += of.Hold(readings).contradicted ? 1 : 0;
    }
    const auto [low, high] = BinomialInterval(contradicted, kSeeds, 0.999);
    EXPECT_LE(low, kGoodnessLevel) << sigma;
    EXPECT_GE(high, kGoodnessLevel) << sigma;
  }
}

TEST(Stated, OfAnAlignmentIsNamedWhereItIsWrong) {
  const Trial trial = TiltedTrial();
  const SampledModel reference(TwoLink(), TwoLink::Truth(), TwoLink::Marks(), 0.0, 4.0, 1e-3);
  Rng rng(3);
  Observations o = Record(TwoLink(), TwoLink::Truth(), TwoLink::Marks(), trial, rng);
  o.placement.offset = Prior::Normal(trial.offset + 0.05, 0.005);
  const Alignment late = Align(o, reference);
  ASSERT_TRUE(late.Usable()) << late.message;
  EXPECT_THAT(ContradictionsOf(o, late),
              ::testing::ElementsAre(::testing::HasSubstr("of the time offset, ")));
  o.placement.offset = Prior::Normal(trial.offset + 0.005, 0.005);
  EXPECT_TRUE(ContradictionsOf(o, Align(o, reference)).empty());
  Pose turned = trial.X_WM;
  turned.linear() = RotationFromVector(Eigen::Vector3d(0.0, 0.0, 0.05)) * turned.linear();
  o.placement.offset = {};
  o.placement.frame = {Foreknowledge::kNormal, turned, 0.005, 0.01};
  EXPECT_THAT(ContradictionsOf(o, Align(o, reference)),
              ::testing::ElementsAre(::testing::HasSubstr("of the frame and the data")));
}

FitResult FitWith(const Observations& data, double mean, double sigma) {
  const Instrumented model;
  std::vector<Parameter> parameters = TwoLinkParameters();
  parameters[0].has_prior = true;
  parameters[0].prior_mean = mean, parameters[0].prior_sigma = sigma;
  return FitOneTrial(model, data, std::move(parameters));
}

// Ten of both standard deviations away. Where the data rule it moves nothing; where it rules, no
// value that rests on it is called determined.
TEST(Stated, OfAParameterIsNamedAndWhatRestsOnItIsNotDetermined) {
  Rng rng(7);
  Observations data =
      Record(TwoLink(), TwoLink::Truth(), {"base", "elbow", "tip"}, SparseTrial(), rng);
  data.placement.drift = Prior::Known(0.0);  // else a clock may explain another frequency
  const double truth = TwoLink::Truth()[0];
  const double own = FitWith(data, truth, 1.0).parameters[0].sigma_data;
  for (const double part : {0.3, 1.0, 100.0}) {
    const double sigma = part * own;
    const FitResult fit = FitWith(data, truth + 10.0 * std::hypot(sigma, own), sigma);
    ASSERT_TRUE(fit.Usable()) << fit.message;
    ASSERT_EQ(fit.stated.size(), 1U);
    EXPECT_TRUE(fit.stated[0].contradicted) << part;
    EXPECT_NEAR(fit.stated[0].without, truth, 4.0 * own) << part;
    EXPECT_EQ(fit.parameters[0].verdict == Verdict::kDetermined, part > 10.0) << part;
    const FitResult right = FitWith(data, truth + 1.5 * sigma, sigma);
    EXPECT_FALSE(right.stated[0].contradicted) << part;
  }
}

// A gain that is stated wrongly is no fault of the model.
TEST(Stated, AWrongGainIsNotTheModelsFault) {
  Rng rng(8);
  Instrument encoder;
  encoder.quantity = "first.angle", encoder.sigma = 2e-3;
  Instrument accelerometer;
  ChannelRecord acceleration = Read(accelerometer, 0.7, rng);
  acceleration.gain = Prior::Normal(1.1, 0.005);
  Observations data;
  data.others = {std::make_shared<Channel>(Read(encoder, 0.7, rng)),
                 std::make_shared<Channel>(std::move(acceleration))};
  const FitResult fit = FitInstruments(data);
  ASSERT_TRUE(fit.Usable()) << fit.message;
  ASSERT_EQ(fit.stated.size(), 1U);
  EXPECT_EQ(fit.stated[0].name, "gain of first.acceleration");
  EXPECT_TRUE(fit.stated[0].contradicted);
  EXPECT_NEAR(fit.stated[0].without, 1.0, 0.01);
  EXPECT_EQ(fit.trials[0].goodness.outcome, Explained::kYes);
  for (const ParameterEstimate& e : fit.parameters) EXPECT_EQ(e.verdict, Verdict::kDetermined);
}

// Marks that weigh little beside a gyroscope whose gain is sought: whole steps lead up from here,
// and no number of those taken does.
TEST(Stated, ARegistrationNeverLeadsUp) {
  Rng rng(9);
  Trial trial = SparseTrial();
  trial.sigma = 0.02;
  Observations o = Record(TwoLink(), TwoLink::Truth(), {"elbow", "tip"}, trial, rng);
  Instrument gyro;
  gyro.quantity = "first.rate", gyro.sigma = 5e-3;
  ChannelRecord record = Read(gyro, trial.offset, rng);
  record.bias = Prior::Free();
  record.gain = Prior::Free();
  o.others = {std::make_shared<Channel>(std::move(record))};
  const Instrumented model;
  RegistrationOptions options;
  options.with_others = true;
  for (const double late : {-0.4, -0.2, 0.2, 0.4}) {
    const double offset = trial.offset + late;
    const Prediction at = model.Evaluate(TwoLink::Truth(), o.StampsAt(offset));
    const Registration start = StartingFrame(o, at, offset);
    double before = std::numeric_limits<double>::infinity();
    for (options.max_iterations = 0; options.max_iterations < 12; ++options.max_iterations) {
      const double sum = FitRegistration(o, at, offset, start, options).SumOfSquares();
      EXPECT_LE(sum, before * (1.0 + 1e-9)) << late << " after " << options.max_iterations;
      before = sum;
    }
  }
}

// A model that rests, but for rounding: by that the clock would leave the record, where nothing is
// left to be off.
TEST(Stated, AClockThatNothingTellsStays) {
  class Resting : public Model {
   public:
    Prediction Evaluate(std::span<const double> /*theta*/, const Stamps& stamps) const override {
      Prediction out;
      for (const QuantityStamps& q : stamps.quantities) {
        Eigen::VectorXd values(static_cast<Eigen::Index>(q.t.size()));
        for (Eigen::Index i = 0; i < values.size(); ++i) {
          values(i) = i % 3 == 0 ? 0.6 : std::nextafter(0.6, 1.0);
        }
        out.quantities.push_back({q.key, std::move(values)});
      }
      return out;
    }
  };
  Rng rng(10);
  Instrument encoder;
  encoder.quantity = "first.angle", encoder.sigma = 2e-3;
  Observations o;
  o.others = {std::make_shared<Channel>(Read(encoder, 0.7, rng))};
  RegistrationOptions options;
  options.with_others = true;
  Registration start;
  start.offset = 0.7;
  start.own = StartOfOwn(o);
  const Prediction at = Resting().Evaluate({}, o.StampsAt(0.7));
  const RegistrationFit fit = FitRegistration(o, at, 0.7, start, options);
  EXPECT_EQ(fit.at.offset, 0.7);
  EXPECT_GT(fit.data_rows, 250);
  EXPECT_THAT(fit.weak, ::testing::Contains("time offset"));
}

}  // namespace
}  // namespace unfurl::correlate::stated_test
