// Records many swings long and a start whose pace is off: in closed form.
#include "correlate/fit/growing.h"

#include <gtest/gtest.h>

#include <memory>
#include <numbers>

#include "base/random.h"
#include "correlate/fit/goodness.h"
#include "correlate/residual/channel.h"
#include "tests/correlate/fit_repeats.h"

namespace unfurl::correlate::growing_test {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kSeconds = 20.0, kOffset = 0.83;  // 22 swings; what the clock shows at the release
constexpr double kReleased = 0.7;                  // [rad]

// An arm of 0.9 m that swings in its plane as a damped oscillator, held until t = 0. Parameters:
// frequency [Hz], decay [1/s].
class Arm : public Model {
 public:
  static std::vector<double> Truth() { return {1.1, 0.08}; }
  // The angle and its derivatives by time.
  static double Angle(std::span<const double> theta, double t, int derivative) {
    if (t < 0.0) return derivative == 0 ? kReleased : derivative == 1 ? 0.0 : std::nan("");
    const double w = 2.0 * kPi * theta[0], d = theta[1];
    const double e = kReleased * std::exp(-d * t), c = std::cos(w * t), s = std::sin(w * t);
    if (derivative == 0) return e * (c + d / w * s);
    if (derivative == 1) return -e * (w + d * d / w) * s;
    return -e * (w + d * d / w) * (w * c - d * s);
  }
  static int DerivativeOf(const std::string& quantity) {
    return quantity == "angle" ? 0 : quantity == "rate" ? 1 : 2;
  }

  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Prediction out;
    for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
      MarkMotion motion;
      motion.p.setZero(3, static_cast<Eigen::Index>(stamps.t[m].size()));
      motion.v = motion.p;
      for (Eigen::Index i = 0; i < motion.p.cols(); ++i) {
        const double t = stamps.t[m][static_cast<std::size_t>(i)];
        const double q = Angle(theta, t, 0), rate = Angle(theta, t, 1);
        motion.p.col(i) << 0.9 * std::cos(q), 0.9 * std::sin(q), 0.0;
        motion.v.col(i) << -0.9 * std::sin(q) * rate, 0.9 * std::cos(q) * rate, 0.0;
        if (stamps.marks[m] != "hub") continue;
        motion.p.col(i) << 0.1, -0.3, 0.0;
        motion.v.col(i).setZero();
      }
      out.marks.push_back(std::move(motion));
    }
    for (const QuantityStamps& q : stamps.quantities) {
      Eigen::VectorXd values(static_cast<Eigen::Index>(q.t.size()));
      for (Eigen::Index i = 0; i < values.size(); ++i) {
        values(i) = Angle(theta, q.t[static_cast<std::size_t>(i)], DerivativeOf(q.quantity));
      }
      out.quantities.push_back({q.key, std::move(values)});
    }
    return out;
  }
};

// What an instrument of the arm reads, its bias unknown, every 40 ms.
std::shared_ptr<Channel> Readings(const std::string& quantity, double sigma, Rng& rng) {
  ChannelRecord c;
  c.name = c.quantity = quantity;
  c.unit = "1";
  std::vector<double> y;
  for (double t = quantity == "acceleration" ? 0.05 : -0.3; t < kSeconds; t += 0.04) {
    c.t.push_back(t + kOffset);
    y.push_back(Arm::Angle(Arm::Truth(), t, Arm::DerivativeOf(quantity)) + 0.05 +
                sigma * rng.Normal());
  }
  c.pivot = 0.5 * (c.t.front() + c.t.back());
  c.y = Eigen::Map<const Eigen::VectorXd>(y.data(), static_cast<Eigen::Index>(y.size()));
  c.sigma = Eigen::VectorXd::Constant(c.y.size(), sigma);
  c.bias = Prior::Free();
  return std::make_shared<Channel>(std::move(c));
}

MarkSeries Mark(const std::string& name, double sigma, Rng& rng) {
  Stamps stamps;
  stamps.marks = {name};
  stamps.t.resize(1);
  for (double t = -0.3; t < kSeconds; t += 0.05) stamps.t[0].push_back(t);
  MarkSeries m;
  m.name = name;
  m.p = Arm().Evaluate(Arm::Truth(), stamps).marks[0].p;
  m.cov.setZero(6, m.p.cols());
  m.shared.resize(3, 0);
  for (Eigen::Index i = 0; i < m.p.cols(); ++i) {
    for (double& x : m.p.col(i)) x += sigma * rng.Normal();
    for (const int diagonal : {0, 3, 5}) m.cov(diagonal, i) = sigma * sigma;
    m.t.push_back(stamps.t[0][static_cast<std::size_t>(i)] + kOffset);
  }
  return m;
}

FitResult FitFrom(double off, const Observations& data, int screened = SearchOptions::kAsNeeded) {
  static const Arm model;
  FitProblem problem;
  std::vector<Parameter>& parameters = problem.parameters;
  parameters.resize(2);
  Parameter &frequency = parameters[0], &decay = parameters[1];
  frequency.name = "frequency", frequency.unit = "Hz", frequency.start = 1.1 * (1.0 + off);
  frequency.low = 0.5, frequency.high = 2.5;
  decay.name = "decay", decay.unit = "1/s", decay.start = 0.1, decay.low = 0.01, decay.high = 1.0;
  decay.log = true;
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.trials[0].observations = &data;
  FitOptions options;
  options.profile.wanted = false;
  options.workers = 1;
  options.search.screened = screened;
  return Fit(problem, options);
}

void ExpectFound(double off, const Observations& data) {
  const FitResult fit = FitFrom(off, data);
  ASSERT_TRUE(fit.Usable()) << off << ": " << fit.message;
  for (std::size_t j = 0; j < 2; ++j) {
    const ParameterEstimate& e = fit.parameters[j];
    EXPECT_NEAR(e.value, Arm::Truth()[j], 4.0 * e.sigma) << j << " from " << off;
    EXPECT_EQ(e.verdict, Verdict::kDetermined) << e.reason;
  }
  EXPECT_NEAR(fit.trials[0].at.offset, kOffset, 1e-3);
}

TEST(Growing, MarksAndAGyroscope) {
  Rng rng(4);
  Observations data;
  data.marks = {Mark("hub", 3e-4, rng), Mark("tip", 3e-4, rng)};
  data.others = {Readings("rate", 0.01, rng)};
  for (const double off : {-0.1, -0.02, 0.02, 0.1}) ExpectFound(off, data);
}

TEST(Growing, AnInstrumentAlone) {
  Rng rng(5);
  for (const char* quantity : {"angle", "rate", "acceleration"}) {
    Observations data;
    data.others = {Readings(quantity, 0.01, rng)};
    ExpectFound(quantity == std::string("rate") ? -0.1 : 0.03, data);
  }
}

// A start that no part of a short record lies beside: points over the bounds lead.
TEST(Growing, AFarStartIsLedFromTheBounds) {
  Rng rng(8);
  ChannelRecord c = Readings("acceleration", 0.5, rng)->record();
  constexpr Eigen::Index kFew = 75;  // readings: 3 s
  c.t.resize(kFew), c.y = c.y.head(kFew).eval(), c.sigma = c.sigma.head(kFew).eval();
  Observations data;
  data.others = {std::make_shared<Channel>(std::move(c))};
  int lost = 0;
  for (const double off : {-0.5, -0.4, 0.6, 0.9}) {
    lost += FitFrom(off, data, 0).status == FitStatus::kNotAligned ? 1 : 0;
    EXPECT_NEAR(FitFrom(off, data).parameters[0].value, 1.1, 0.02) << off;
  }
  EXPECT_GT(lost, 0);
}

// The first swings of anything look like those of anything else: where the whole record does not
// lie beside the model in the end, there is no result.
TEST(Growing, AnotherMotionIsNotAligned) {
  Rng rng(6);
  Observations data;
  std::shared_ptr<Channel> readings = Readings("angle", 0.01, rng);
  ChannelRecord chirp = readings->record();
  for (Eigen::Index i = 0; i < chirp.y.size(); ++i) {
    const double t = std::max(0.0, chirp.t[static_cast<std::size_t>(i)] - kOffset);
    chirp.y(i) = 0.7 * std::cos(2.0 * kPi * (1.1 + 0.15 * t) * t) + 0.01 * rng.Normal();
  }
  data.others = {std::make_shared<Channel>(std::move(chirp))};
  EXPECT_EQ(FitFrom(0.02, data).status, FitStatus::kNotAligned);
}

TEST(Growing, HorizonsAreHalvedAndGrow) {
  Rng rng(7);
  Observations data;
  data.others = {Readings("angle", 0.01, rng)};
  FitProblem problem;
  problem.parameters.resize(2);
  problem.trials.resize(1);
  problem.trials[0].observations = &data;
  FitOptions options;
  const std::vector<FitOptions> all = GrowingHorizons(problem, options);
  ASSERT_GT(all.size(), 2U);
  EXPECT_NEAR(all[0].stages.front() / all[1].stages.front(), 2.0, 1e-9);
  for (const FitOptions& one : all) {
    one.Check();
    EXPECT_LT(one.stages.back(), kSeconds + 0.5);
  }
  options.stages = {1.0};
  EXPECT_TRUE(GrowingHorizons(problem, options).empty());
}

}  // namespace
}  // namespace unfurl::correlate::growing_test
