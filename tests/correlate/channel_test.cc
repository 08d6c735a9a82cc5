// Channels of instruments as residuals.
#include "correlate/residual/channel.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/dense.h"
#include "base/error.h"
#include "base/statistics.h"
#include "correlate/residual/row_layout.h"
#include "tests/correlate/instruments.h"

namespace unfurl::correlate::channel_test {
namespace {

constexpr double kOffset = 0.7312;

Observations Of(ChannelRecord record) {
  Observations out;
  out.others = {std::make_shared<Channel>(std::move(record))};
  return out;
}

ResidualKind::Rows RowsOf(const Channel& channel) {
  ResidualKind::Rows rows;
  rows.residual.resize(channel.rows());
  rows.by_time.resize(channel.rows());
  rows.by_unknown.resize(channel.rows(), static_cast<Eigen::Index>(channel.unknowns().size()));
  return rows;
}

// Derivatives by all unknowns and by time against differences, with a filter at work.
TEST(Channel, DerivativesAreThoseOfTheResiduals) {
  Rng rng(3);
  Instrument gyroscope;
  gyroscope.quantity = "first.rate";
  gyroscope.gain = 1.1, gyroscope.bias = 0.2, gyroscope.delay = 0.02, gyroscope.drift = 2e-3;
  ChannelRecord record = Read(gyroscope, kOffset, rng);
  record.gain = Prior::Free();
  record.bias = Prior::Normal(0.1, 0.3);
  record.delay = Prior::Normal(0.0, 0.05);
  record.drift = Prior::Free();
  record.filter.kind = LowPass::Kind::kButterworth;
  record.filter.order = 2;
  record.filter.cutoff = 10.0;
  const Observations data = Of(std::move(record));
  const auto& channel = dynamic_cast<const Channel&>(*data.others[0]);
  const Clock reference(kOffset, 1e-4), at(kOffset + 1e-3, 2e-4);
  const Prediction prediction = Instrumented().Evaluate(TwoLink::Truth(), data.StampsAt(reference));
  const Eigen::VectorXd numbers = channel.NumbersOf(prediction);
  Eigen::VectorXd unknowns(4);
  unknowns << 1.05, 0.15, 0.01, 1e-3;
  ResidualKind::Rows rows = RowsOf(channel), moved = RowsOf(channel);
  const ResidualKind::Clocks clocks = ClocksOf(data, reference, at);
  channel.Evaluate(numbers, clocks, unknowns, &rows);
  EXPECT_EQ(rows.known, static_cast<Eigen::Index>(channel.record().t.size()));
  for (Eigen::Index j = 0; j < 4; ++j) {
    constexpr double kStep = 1e-6;
    Eigen::VectorXd beside = unknowns;
    beside(j) += kStep;
    channel.Evaluate(numbers, clocks, beside, &moved);
    const Eigen::VectorXd by_difference = (moved.residual - rows.residual) / kStep;
    EXPECT_LT((by_difference - rows.by_unknown.col(j)).cwiseAbs().maxCoeff(),
              2e-4 * rows.by_unknown.col(j).cwiseAbs().maxCoeff())
        << channel.unknowns()[static_cast<std::size_t>(j)].name;
  }
  ResidualKind::Clocks later = clocks;
  later.at.offset -= 1e-6;
  channel.Evaluate(numbers, later, unknowns, &moved);
  EXPECT_LT(((moved.residual - rows.residual) / 1e-6 - rows.by_time).cwiseAbs().maxCoeff(),
            2e-4 * rows.by_time.cwiseAbs().maxCoeff());
  // A change of the model acts as the difference of two models.
  Prediction other =
      Instrumented().Evaluate(std::vector<double>{0.93, 0.3}, data.StampsAt(reference));
  const Eigen::VectorXd change = channel.NumbersOf(other) - numbers;
  channel.Evaluate(numbers + change, clocks, unknowns, &moved);
  EXPECT_LT((moved.residual - rows.residual - channel.Response(change, clocks, unknowns))
                .cwiseAbs()
                .maxCoeff(),
            1e-9 * rows.residual.norm());
}

// What the model says between the points of its grid, at true values of all: the noise alone is
// left. Two rates, two clocks.
TEST(Channel, AtTheTruthNothingButNoiseIsLeft) {
  for (const auto& [step, delay, drift] :
       {std::tuple{0.01, 0.0, 0.0}, {0.0037, 0.25, 0.0}, {0.02, -0.1, 5e-3}}) {
    Rng rng(5);
    Instrument encoder;
    encoder.quantity = "first.angle";
    encoder.from = -0.4, encoder.step = step, encoder.delay = delay, encoder.drift = drift;
    encoder.sigma = 1e-4;
    ChannelRecord record = Read(encoder, kOffset, rng);
    record.delay = Prior::Known(delay);
    record.drift = Prior::Known(drift);
    const Observations data = Of(std::move(record));
    const auto& channel = dynamic_cast<const Channel&>(*data.others[0]);
    const Clock clock(kOffset);
    const Prediction prediction = Instrumented().Evaluate(TwoLink::Truth(), data.StampsAt(clock));
    ResidualKind::Rows rows = RowsOf(channel);
    channel.Evaluate(channel.NumbersOf(prediction), ClocksOf(data, clock, clock), {}, &rows);
    EXPECT_EQ(rows.known, rows.residual.size());
    const double n = static_cast<double>(rows.residual.size());
    EXPECT_NEAR(rows.residual.squaredNorm() / n, 1.0, 5.0 * std::sqrt(2.0 / n)) << step;
  }
}

// Where a record begins and ends, what a window holds and when a reading was: all by the record's
// clock, whatever the instrument's shows.
TEST(Channel, LiesOnTheRecordsClock) {
  constexpr double kRounding = 1e-9;  // of stamps of hundreds of seconds [s]
  for (const auto& [delay, drift] : {std::pair{0.5, 0.0}, {-300.0, 0.0}, {100.0, 5e-3}}) {
    Rng rng(5);
    Instrument encoder;
    encoder.quantity = "first.angle", encoder.sigma = 1e-4;
    const ChannelRecord plain = Read(encoder, kOffset, rng);
    encoder.delay = delay, encoder.drift = drift;
    ChannelRecord record = Read(encoder, kOffset, rng);
    for (const bool fitted : {false, true}) {
      record.delay = fitted ? Prior::Normal(delay, 0.01) : Prior::Known(delay);
      record.drift = fitted ? Prior::Normal(drift, 1e-4) : Prior::Known(drift);
      const Observations data = Of(record);
      EXPECT_NEAR(data.Start(), plain.t.front(), kRounding);
      EXPECT_NEAR(data.End(), plain.t.back(), kRounding);
      EXPECT_NEAR(data.Pivot(), 0.5 * (plain.t.front() + plain.t.back()), kRounding);
      const auto& channel = dynamic_cast<const Channel&>(*data.others[0]);
      const std::vector<double>& stamps = *RowLayout(data).series[0].t;
      ASSERT_EQ(stamps.size(), plain.t.size());
      for (std::size_t i = 0; i < stamps.size(); ++i) {
        EXPECT_NEAR(stamps[i], plain.t[i], kRounding);
        EXPECT_EQ(channel.TimeOf(static_cast<Eigen::Index>(i)), stamps[i]);
        EXPECT_NEAR(channel.OwnTime(stamps[i]), record.t[i], kRounding);
      }
      constexpr std::size_t kKept = 101;  // readings
      const Observations part = Cut(data, {0.0, plain.t[kKept - 1] + 0.5 * encoder.step});
      EXPECT_EQ(part.readings(), kKept);
      EXPECT_EQ(part.Pivot(), data.Pivot());
    }
    record.delay = Prior::Known(0.0), record.drift = Prior::Known(0.0);
    EXPECT_EQ(Of(record).Start(), record.t.front());
    EXPECT_EQ(Of(record).End(), record.t.back());
  }
}

// Unknown before the release, and for as long as the filter remembers it.
TEST(Channel, WhatTheModelDoesNotKnowDoesNotCount) {
  Rng rng(5);
  Instrument accelerometer;
  accelerometer.from = -0.2;
  ChannelRecord record = Read(accelerometer, kOffset, rng);
  for (double& y : record.y) y = std::isnan(y) ? 0.0 : y;
  const Clock clock(kOffset);
  auto known = [&](const ChannelRecord& r) {
    const Observations data = Of(r);
    const auto& channel = dynamic_cast<const Channel&>(*data.others[0]);
    const Prediction prediction = Instrumented().Evaluate(TwoLink::Truth(), data.StampsAt(clock));
    ResidualKind::Rows rows = RowsOf(channel);
    channel.Evaluate(channel.NumbersOf(prediction), ClocksOf(data, clock, clock), {}, &rows);
    return static_cast<std::size_t>(rows.known);
  };
  const auto after = static_cast<std::size_t>(
      std::count_if(record.t.begin(), record.t.end(), [](double t) { return t > kOffset; }));
  const std::size_t plain = known(record);
  EXPECT_LE(plain, after);
  EXPECT_GE(plain + 2, after);
  record.filter.kind = LowPass::Kind::kAverage;
  record.filter.width = 0.3;
  EXPECT_NEAR(static_cast<double>(plain - known(record)), 0.3 / accelerometer.step, 2.0);
}

TEST(Channel, NoiseOfReadingsIsThatOfTheirThirdDifferences) {
  Rng rng(8);
  Eigen::VectorXd y(5000);
  for (Eigen::Index i = 0; i < y.size(); ++i) {
    y(i) = std::sin(0.02 * static_cast<double>(i)) + (i > 2500 ? 1.0 : 0.0) + 0.01 * rng.Normal();
  }
  EXPECT_NEAR(NoiseOf(y), 0.01, 5e-4);
  // An encoder of which most readings repeat the one before.
  for (Eigen::Index i = 0; i < y.size(); ++i) {
    y(i) = 0.5 * std::floor(std::sin(1e-3 * static_cast<double>(i)) / 0.5);
  }
  EXPECT_NEAR(NoiseOf(y), 0.5 / std::sqrt(12.0), 1e-12);
  EXPECT_EQ(NoiseOf(Eigen::VectorXd::Ones(50)), 0.0);
}

TEST(Channel, BadRecordsAreNamed) {
  Rng rng(1);
  auto message = [&](auto&& change) {
    ChannelRecord record = Read({}, kOffset, rng);
    change(&record);
    try {
      const Channel channel(std::move(record), "study.toml:7");
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("none");
  };
  using ::testing::HasSubstr;
  EXPECT_EQ(message([](ChannelRecord*) {}), "none");
  EXPECT_THAT(message([](ChannelRecord* r) { r->t[5] = r->t[4]; }), HasSubstr("do not ascend"));
  EXPECT_THAT(message([](ChannelRecord* r) { r->y(3) = std::nan(""); }), HasSubstr("not finite"));
  EXPECT_THAT(message([](ChannelRecord* r) { r->sigma(3) = 0.0; }), HasSubstr("not positive"));
  EXPECT_THAT(message([](ChannelRecord* r) { r->t.back() += 1e6; }), HasSubstr("bursts"));
  EXPECT_THAT(message([](ChannelRecord* r) { r->sigma.resize(0), r->y.setOnes(); }),
              HasSubstr("never change"));
  EXPECT_THAT(message([](ChannelRecord* r) { r->filter.kind = LowPass::Kind::kBessel; }),
              HasSubstr("filter.order"));
}

// 1000 repeats with the label slow.
TEST(ChannelFit, AnAccelerometerAloneGainAndBiasUnknown) {
  ExpectHonest(RepeatAccelerometer(60, 100, true));
}

TEST(ChannelFit, NoiseThatNobodyStatedIsFound) {
  constexpr int kSeeds = 60;
  const Coverage c = RepeatAccelerometer(kSeeds, 5000, false);
  ExpectHonest(c);
  for (const auto& z : c.z) EXPECT_NEAR(Variance(z), 1.0, 4.0 * std::sqrt(2.0 / kSeeds));
}

// With clock and frame known nothing is shared, so that the information of marks, accelerometer and
// switch is the sum of each alone.
TEST(ChannelFit, TogetherTheyKnowAsMuchAsTheirInformationSays) {
  Rng rng(17);
  Trial trial = SparseTrial();
  trial.sigma = 5e-3;
  Observations marks = Record(TwoLink(), TwoLink::Truth(), {"elbow", "tip"}, trial, rng);
  marks.placement.offset = Prior::Known(trial.offset);
  marks.placement.drift = Prior::Known(0.0);
  marks.placement.frame = {Foreknowledge::kKnown, trial.X_WM, 0.0, 0.0};
  Instrument accelerometer;
  accelerometer.sigma = 0.1;
  const auto channel = std::make_shared<Channel>(Read(accelerometer, trial.offset, rng));
  std::vector<TimedEvent> passings;
  for (int k = 1; k <= 4; ++k) {
    const double t = (0.5 * k - 0.25) / TwoLink::Truth()[0] + trial.offset;
    passings.push_back({"latch", "elbow", k, t + 1e-3 * rng.Normal(), 1e-3});
  }
  const auto events = std::make_shared<TimedEvents>(passings);
  auto with = [&](bool tracks, ResidualKinds others) {
    Observations data = marks;
    if (!tracks) data.marks.clear();
    data.others = std::move(others);
    return FitInstruments(data);
  };
  const FitResult all = with(true, {channel, events}), first = with(true, {}),
                  second = with(false, {channel});
  ASSERT_TRUE(all.Usable() && first.Usable() && second.Usable()) << all.message << second.message;
  const Eigen::Matrix2d together = all.covariance.inverse();
  Eigen::Matrix2d sum = first.covariance.inverse() + second.covariance.inverse();
  double switched = 0.0;  // the switch tells of the frequency alone
  for (int k = 1; k <= 4; ++k) {
    const double slope = (0.5 * k - 0.25) / std::pow(TwoLink::Truth()[0], 2) / 1e-3;
    switched += slope * slope;
  }
  sum(0, 0) += switched;
  EXPECT_NEAR(together(0, 0) / sum(0, 0), 1.0, 0.05);
  EXPECT_NEAR(together(1, 1) / sum(1, 1), 1.0, 0.05);
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_LT(all.parameters[j].sigma, 0.99 * first.parameters[j].sigma);
    EXPECT_LT(all.parameters[j].sigma, 0.99 * second.parameters[j].sigma);
  }
}

// Three instruments, three rates, two of them by clocks of their own, beside no mark at all.
TEST(ChannelFit, SeveralRatesAndSeveralClocks) {
  Rng rng(23);
  Instrument encoder, gyroscope, accelerometer;
  encoder.quantity = "first.angle", encoder.step = 0.02, encoder.sigma = 1e-3, encoder.from = -0.3;
  gyroscope.quantity = "first.rate", gyroscope.step = 0.004, gyroscope.sigma = 0.05;
  gyroscope.delay = 0.013, gyroscope.gain = 0.98;
  accelerometer.step = 0.003, accelerometer.drift = 4e-3, accelerometer.delay = -0.02;
  accelerometer.bias = 0.7;
  ChannelRecord records[] = {Read(encoder, kOffset, rng), Read(gyroscope, kOffset, rng),
                             Read(accelerometer, kOffset, rng)};
  records[1].delay = Prior::Normal(0.0, 0.05);
  records[1].gain = Prior::Normal(1.0, 0.05);
  records[2].delay = Prior::Normal(0.0, 0.05);
  records[2].drift = Prior::Normal(0.0, 0.01);
  records[2].bias = Prior::Free();
  Observations data;
  for (ChannelRecord& r : records) {
    data.others.push_back(std::make_shared<Channel>(std::move(r)));
  }
  const FitResult fit = FitInstruments(data, true);
  ASSERT_TRUE(fit.Usable()) << fit.message;
  EXPECT_EQ(fit.trials[0].goodness.outcome, Explained::kYes);
  const double truth[] = {kOffset, 0.98, 0.013, 0.7, -0.02, 4e-3};
  const TrialResult& trial = fit.trials[0];
  ASSERT_EQ(trial.nuisances.size(), 6U);
  constexpr double kFar = 4.0;  // standard errors
  for (std::size_t i = 0; i < 6; ++i) {
    const double sigma = trial.nuisance_sigma(static_cast<Eigen::Index>(i));
    EXPECT_LT(std::abs(ValueOf(trial.nuisances[i], trial.registration) - truth[i]), kFar * sigma)
        << trial.nuisances[i].Name();
    EXPECT_GT(sigma, 0.0);
  }
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_LT(std::abs(fit.parameters[j].value - TwoLink::Truth()[j]),
              kFar * fit.parameters[j].sigma);
  }
}

// What its low pass does to an instrument is the model's to do, too: left out it biases the decay.
TEST(ChannelFit, TheInstrumentsFilterIsTheModels) {
  Rng rng(29);
  Instrument fine;
  fine.step = 2e-4, fine.sigma = 1e-9, fine.to = 3.2;
  ChannelRecord record = Read(fine, kOffset, rng);
  record.filter.kind = LowPass::Kind::kButterworth;
  record.filter.order = 2;
  record.filter.cutoff = 5.0;
  const Eigen::VectorXd seen = record.filter.Apply(record.y, fine.step);
  ChannelRecord sampled = record;
  sampled.t.clear();
  std::vector<double> y;
  const auto forget = static_cast<std::size_t>(2.0 * record.filter.Memory() / fine.step);
  for (std::size_t i = forget; i < record.t.size(); i += 50) {
    sampled.t.push_back(record.t[i]);
    y.push_back(seen(static_cast<Eigen::Index>(i)) + 0.05 * rng.Normal());
  }
  sampled.y = Eigen::Map<const Eigen::VectorXd>(y.data(), static_cast<Eigen::Index>(y.size()));
  sampled.sigma = Eigen::VectorXd::Constant(sampled.y.size(), 0.05);
  sampled.pivot = std::nan("");
  const FitResult right = FitInstruments(Of(sampled));
  sampled.filter = {};
  const FitResult wrong = FitInstruments(Of(sampled));
  ASSERT_TRUE(right.Usable()) << right.message;
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_LT(std::abs(right.parameters[j].value - TwoLink::Truth()[j]),
              4.0 * right.parameters[j].sigma);
  }
  EXPECT_EQ(right.trials[0].goodness.outcome, Explained::kYes);
  // Without it the values or the verdict show it.
  EXPECT_TRUE(wrong.trials[0].goodness.outcome != Explained::kYes ||
              std::abs(wrong.parameters[1].value - TwoLink::Truth()[1]) <
                  4.0 * wrong.parameters[1].sigma);
}

// A record that shows something else is no alignment.
TEST(ChannelFit, AnotherMotionIsNotAligned) {
  Rng rng(31);
  ChannelRecord record = Read({}, kOffset, rng);
  for (Eigen::Index i = 0; i < record.y.size(); ++i) record.y(i) = rng.Normal();
  const FitResult fit = FitInstruments(Of(record));
  EXPECT_EQ(fit.status, FitStatus::kNotAligned);
  EXPECT_THAT(fit.message, ::testing::HasSubstr("share nothing"));
}

}  // namespace
}  // namespace unfurl::correlate::channel_test
