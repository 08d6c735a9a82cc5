// What a model does between the samples of a record, on motions in closed form; and fits to records
// that are sampled more slowly than they swing.
#include "correlate/fit/between_samples.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>

#include "base/random.h"
#include "correlate/fit/fit.h"
#include "correlate/residual/channel.h"

namespace unfurl::correlate::between_samples_test {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kStep = 0.1, kEnd = 6.0;  // of the records [s]
constexpr double kSigma = 0.01;            // [rad], [m]; the motion's amplitude is 1

// A damped swing and a mark that follows it along x. Parameters: frequency [Hz] and decay [1/s].
class Swing : public Model {
 public:
  static double At(std::span<const double> theta, double t) {
    if (t <= 0.0) return 1.0;
    return std::exp(-theta[1] * t) * std::cos(2.0 * kPi * theta[0] * t);
  }
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Prediction out;
    for (const std::vector<double>& times : stamps.t) {
      MarkMotion motion;
      motion.p.setZero(3, static_cast<Eigen::Index>(times.size()));
      motion.v = motion.p;
      for (Eigen::Index i = 0; i < motion.p.cols(); ++i) {
        motion.p(0, i) = At(theta, times[static_cast<std::size_t>(i)]);
      }
      out.marks.push_back(std::move(motion));
    }
    for (const QuantityStamps& q : stamps.quantities) {
      Eigen::VectorXd values(static_cast<Eigen::Index>(q.t.size()));
      for (Eigen::Index i = 0; i < values.size(); ++i) {
        values(i) = At(theta, q.t[static_cast<std::size_t>(i)]);
      }
      out.quantities.push_back({q.key, std::move(values)});
    }
    return out;
  }
};

struct Recorded {
  double frequency = 0.6, decay = 0.05;  // [Hz], [1/s]
  bool mark = false, states_sigma = true;
  double noise = kSigma;
  double sigma = kSigma;  // that is stated
};

Observations Record(const Recorded& r, std::uint64_t seed) {
  Rng rng(seed);
  const std::vector<double> truth = {r.frequency, r.decay};
  std::vector<double> t;
  for (int i = 0; i * kStep <= kEnd; ++i) t.push_back(i * kStep);
  const auto n = static_cast<Eigen::Index>(t.size());
  Eigen::VectorXd y(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    y(i) = Swing::At(truth, t[static_cast<std::size_t>(i)]) + r.noise * rng.Normal();
  }
  Observations out;
  out.placement.offset = Prior::Known(0.0);
  out.placement.frame.kind = Foreknowledge::kKnown;
  if (r.mark) {
    MarkSeries m;
    m.name = "bob";
    m.t = t;
    m.p.setZero(3, n);
    m.p.row(0) = y.transpose();
    m.cov.setZero(6, n);
    for (const Eigen::Index axis : {0, 3, 5}) m.cov.row(axis).setConstant(r.sigma * r.sigma);
    m.shared.resize(3, 0);
    for (Eigen::Index i = 0; i < n; ++i) {
      m.p(1, i) = r.noise * rng.Normal();
      m.p(2, i) = r.noise * rng.Normal();
    }
    out.marks.push_back(std::move(m));
    return out;
  }
  ChannelRecord c;
  c.name = c.quantity = "angle";
  c.unit = "rad";
  c.t = t;
  c.y = y;
  if (r.states_sigma) c.sigma = Eigen::VectorXd::Constant(n, r.sigma);
  out.others = {std::make_shared<Channel>(std::move(c))};
  return out;
}

BetweenSamples Look(const Observations& o, const std::vector<double>& theta) {
  const Swing model;
  const Stamps stamps = o.StampsAt({});
  const Prediction at = model.Evaluate(theta, stamps);
  Registration known;
  known.own = StartOfOwn(o);
  known.z.resize(0);
  RegistrationOptions stay;
  stay.max_iterations = 0;
  stay.with_others = true;
  const RegistrationFit fit = FitRegistration(o, at, {}, known, stay);
  return LookBetween(o, at, model.Evaluate(theta, StampsBetween(stamps)), {}, fit.at, fit.residual);
}

// A swing of which there are two and a half samples a period and fewer is hidden, one of three and
// more is shown; by marks and by channels alike.
TEST(BetweenSamples, FollowTheSamplesOfAPeriod) {
  for (const bool mark : {false, true}) {
    for (const double a_period : {1.7, 2.1, 2.5, 3.0, 4.0, 8.0, 30.0}) {
      Recorded how;
      how.frequency = 1.0 / (a_period * kStep), how.mark = mark;
      const Observations o = Record(how, 1);
      const BetweenSamples found = Look(o, {how.frequency, how.decay});
      const auto n = static_cast<std::size_t>(kEnd / kStep);
      if (a_period < 2.6) {
        EXPECT_GT(found.samples, n - n / 8) << a_period << mark;
        EXPECT_GT(found.times, 10.0) << a_period << mark;
      } else {
        EXPECT_EQ(found.samples, 0U) << a_period << mark;
      }
    }
  }
}

// What is less than half of the residuals hides no wrong minimum.
TEST(BetweenSamples, AreNothingBesideLargerResiduals) {
  Recorded how;
  how.frequency = 4.6, how.noise = 3.0;
  EXPECT_EQ(Look(Record(how, 1), {how.frequency, how.decay}).samples, 0U);
}

Parameter Named(const char* name, double start, double low, double high) {
  Parameter p;
  p.name = name, p.unit = "1", p.start = start, p.low = low, p.high = high;
  return p;
}

FitResult FitTo(const Observations& data, double start, double low, double high) {
  static const Swing model;
  FitProblem problem;
  problem.parameters = {Named("frequency", start, low, high), Named("decay", 0.02, 0.0, 0.5)};
  FitTrial trial;
  trial.observations = &data;
  trial.model = &model;
  problem.trials = {trial};
  return Fit(problem);
}

bool Holds(const Interval& interval, double value) {
  return !(value < interval.low) && !(value > interval.high);  // an open side is NaN
}

// 10 samples a second of 7.3 swings. Where no sigma is stated any minimum's residuals look like
// noise; nothing may be called determined that is not the truth's.
TEST(BetweenSamples, NoWrongMinimumIsDetermined) {
  int known = 0;
  for (const bool states_sigma : {false, true}) {
    for (const double start : {5.3, 5.9, 6.5, 7.0, 7.35, 7.8, 8.6, 9.3}) {
      Recorded how;
      how.frequency = 7.3, how.states_sigma = states_sigma;
      const FitResult fit = FitTo(Record(how, 2), start, 5.1, 9.9);
      ASSERT_TRUE(fit.Usable()) << fit.message;
      const ParameterEstimate& e = fit.parameters[0];
      if (e.verdict != Verdict::kDetermined) continue;
      ++known;
      EXPECT_LT(std::abs(e.value - how.frequency), 4.0 * e.sigma) << start << states_sigma;
    }
  }
  EXPECT_GE(known, 14);  // of 16: it is found, too
}

// Residuals of half of the motion that is not shown may be what is left of it at a wrong minimum,
// unless somebody says that noise is as large.
TEST(BetweenSamples, OfTheSizeOfTheResidualsDetermineNothing) {
  for (const bool states_sigma : {false, true}) {
    Recorded how;
    how.frequency = 7.3, how.noise = how.sigma = 0.4, how.states_sigma = states_sigma;
    const FitResult fit = FitTo(Record(how, 4), 7.3, 5.1, 9.9);
    ASSERT_TRUE(fit.Usable()) << fit.message;
    const ParameterEstimate& e = fit.parameters[0];
    EXPECT_EQ(e.verdict == Verdict::kDetermined, states_sigma) << e.reason;
    EXPECT_EQ(std::isnan(e.all95.low), !states_sigma);
  }
}

// With the bounds as wide as an alias the samples do not tell: neither may be claimed.
TEST(BetweenSamples, AnAliasWithinTheBoundsOpensTheInterval) {
  for (const bool mark : {false, true}) {
    Recorded how;
    how.frequency = 7.3, how.states_sigma = false, how.mark = mark;
    if (mark) how.noise = 1.5 * kSigma;  // more than was stated
    const FitResult fit = FitTo(Record(how, 3), 7.2, 5.1, 14.0);
    ASSERT_TRUE(fit.Usable()) << fit.message;
    EXPECT_NE(fit.parameters[0].verdict, Verdict::kDetermined);
    if (!mark) {
      EXPECT_TRUE(Holds(fit.parameters[0].all95, 7.3)) << fit.parameters[0].value;
      EXPECT_TRUE(Holds(fit.parameters[0].all95, 12.7)) << fit.parameters[0].value;
    }
  }
}

// One pace k for an approach, which samples show, and for a swing of k times `frequency`.
class Paced : public Model {
 public:
  explicit Paced(double frequency) : frequency_(frequency) {}
  double At(const std::string& key, double k, double t) const {
    return key == "swing" ? std::sin(2.0 * kPi * frequency_ * k * t) : 1.0 - std::exp(-k * t);
  }
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Prediction out;
    for (const QuantityStamps& q : stamps.quantities) {
      Eigen::VectorXd values(static_cast<Eigen::Index>(q.t.size()));
      for (Eigen::Index i = 0; i < values.size(); ++i) {
        values(i) = At(q.key, theta[0], q.t[static_cast<std::size_t>(i)]);
      }
      out.quantities.push_back({q.key, std::move(values)});
    }
    return out;
  }

 private:
  double frequency_;
};

struct PacedRecord {
  double frequency;       // [Hz]
  double sigma_approach;  // [1]
};

FitResult FitPace(const PacedRecord& how, double start, std::uint64_t seed) {
  const Paced model(how.frequency);
  Rng rng(seed);
  Observations data;
  data.placement.offset = Prior::Known(0.0);
  data.placement.frame.kind = Foreknowledge::kKnown;
  for (const char* key : {"approach", "swing"}) {
    ChannelRecord c;
    c.name = c.quantity = key;
    c.unit = "1";
    const double sigma = c.name == "swing" ? 5.0 * kSigma : how.sigma_approach;
    for (int i = 0; i * kStep <= kEnd; ++i) c.t.push_back(i * kStep);
    c.y.resize(static_cast<Eigen::Index>(c.t.size()));
    for (std::size_t i = 0; i < c.t.size(); ++i) {
      c.y(static_cast<Eigen::Index>(i)) = model.At(key, 1.0, c.t[i]) + sigma * rng.Normal();
    }
    c.sigma = Eigen::VectorXd::Constant(c.y.size(), sigma);
    data.others.push_back(std::make_shared<Channel>(std::move(c)));
  }
  FitProblem problem;
  problem.parameters = {Named("pace", start, 0.5, 2.0)};
  FitTrial trial;
  trial.observations = &data;
  trial.model = &model;
  problem.trials = {trial};
  return Fit(problem);
}

// 20.3 swings from sample to sample: a pace that is faster by one swing in those, 0.049, gives the
// same samples, and the approach knows it to 0.032. Whichever was found, the interval holds 1.
TEST(BetweenSamples, OfAStatedSizeTheErrorIsThatOfTheSamplesThatShow) {
  const PacedRecord how = {203.0, 5.0 * kSigma};
  int elsewhere = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const FitResult fit = FitPace(how, 1.0 + 1.0 / (how.frequency * kStep), seed);
    ASSERT_TRUE(fit.Usable()) << fit.message;
    const ParameterEstimate& e = fit.parameters[0];
    elsewhere += std::abs(e.value - 1.0) > 0.02 ? 1 : 0;
    EXPECT_TRUE(Holds(e.all95, 1.0)) << seed << " " << e.value << " " << e.sigma;
    EXPECT_TRUE(e.verdict != Verdict::kDetermined || e.sigma > 0.03) << seed << " " << e.sigma;
  }
  EXPECT_GE(elsewhere, 5);  // of 10: wrong minima were there to be believed
}

// The same pace with 0.45 swings from sample to sample: what the approach leaves open holds one
// minimum, and the swing's samples count.
TEST(BetweenSamples, CountWhereEveryStartComesBack) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const FitResult fit = FitPace({4.5, kSigma}, 1.01, seed);
    ASSERT_TRUE(fit.Usable()) << fit.message;
    const ParameterEstimate& e = fit.parameters[0];
    EXPECT_EQ(e.verdict, Verdict::kDetermined) << e.reason;
    EXPECT_LT(e.sigma, 1e-3);
    EXPECT_LT(std::abs(e.value - 1.0), 4.0 * e.sigma) << seed;
    EXPECT_EQ(fit.trials[0].between.told, BetweenSamples::Told::kOneMinimum);
  }
}

}  // namespace
}  // namespace unfurl::correlate::between_samples_test
