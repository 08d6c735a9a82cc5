// Several trials of which one is not what the study says of it: of an oscillator in closed form.
#include "study/trials_apart.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <numbers>

#include "base/random.h"
#include "correlate/residual/channel.h"

namespace unfurl::study::trials_apart_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kPi = std::numbers::pi, kSigma = 2e-3;  // [-], of an angle [rad]

// A damped oscillator released from rest at `released`, on an arm with two marks. Parameters:
// frequency [Hz], decay [1/s].
class Swing : public correlate::Model {
 public:
  explicit Swing(double released) : released_(released) {}
  static std::vector<double> Truth() { return {0.8, 0.12}; }
  double Angle(std::span<const double> theta, double t) const {
    const double w = 2.0 * kPi * theta[0], d = theta[1];
    if (t < 0.0) return released_;
    return released_ * std::exp(-d * t) * (std::cos(w * t) + d / w * std::sin(w * t));
  }
  double Rate(std::span<const double> theta, double t) const {
    const double w = 2.0 * kPi * theta[0], d = theta[1];
    return t < 0.0 ? 0.0 : -released_ * std::exp(-d * t) * (w + d * d / w) * std::sin(w * t);
  }
  correlate::Prediction Evaluate(std::span<const double> theta,
                                 const correlate::Stamps& stamps) const override {
    correlate::Prediction out;
    for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
      const double r = stamps.marks[m] == "tip" ? 1.0 : 0.5;
      correlate::MarkMotion motion;
      motion.p.setZero(3, static_cast<Eigen::Index>(stamps.t[m].size()));
      motion.v = motion.p;
      for (Eigen::Index i = 0; i < motion.p.cols(); ++i) {
        const double t = stamps.t[m][static_cast<std::size_t>(i)];
        const double q = Angle(theta, t), rate = Rate(theta, t);
        motion.p.col(i) << r * std::sin(q), -r * std::cos(q), 0.0;
        motion.v.col(i) << r * rate * std::cos(q), r * rate * std::sin(q), 0.0;
      }
      out.marks.push_back(std::move(motion));
    }
    for (const correlate::QuantityStamps& q : stamps.quantities) {
      Eigen::VectorXd values(static_cast<Eigen::Index>(q.t.size()));
      for (Eigen::Index i = 0; i < values.size(); ++i) {
        values(i) = Angle(theta, q.t[static_cast<std::size_t>(i)]);
      }
      out.quantities.push_back({q.key, std::move(values)});
    }
    return out;
  }

 private:
  double released_;
};

// Trials of an encoder, each with its own release, offset and rate of the clock.
class Trials {
 public:
  void Add(double offset, double rate, correlate::Prior said) {
    const std::size_t k = observations_.size();
    models_.push_back(std::make_unique<Swing>(0.6 - 0.1 * static_cast<double>(k)));
    Rng rng(20 + k);
    correlate::ChannelRecord c;
    c.name = c.quantity = "angle";
    c.unit = "rad";
    std::vector<double> y;
    for (double t = -0.3; t < 6.0; t += 0.02) {
      c.t.push_back(offset + (1.0 + rate) * t);
      y.push_back(models_[k]->Angle(Swing::Truth(), t) + kSigma * rng.Normal());
    }
    c.pivot = 0.5 * (c.t.front() + c.t.back());
    c.y = Eigen::Map<const Eigen::VectorXd>(y.data(), static_cast<Eigen::Index>(y.size()));
    c.sigma = Eigen::VectorXd::Constant(c.y.size(), kSigma);
    auto o = std::make_unique<correlate::Observations>();
    o->others = {std::make_shared<correlate::Channel>(std::move(c))};
    o->placement.offset = said;
    observations_.push_back(std::move(o));
  }

  TrialsApart Find() const {
    correlate::FitProblem problem;
    problem.parameters.resize(2);
    correlate::Parameter &f = problem.parameters[0], &d = problem.parameters[1];
    f.name = "frequency", f.unit = "Hz", f.start = 0.82, f.low = 0.5, f.high = 1.2;
    d.name = "decay", d.unit = "1/s", d.start = 0.15, d.low = 0.01, d.high = 1.0, d.log = true;
    for (std::size_t k = 0; k < observations_.size(); ++k) {
      correlate::FitTrial trial;
      trial.name = "trial " + std::to_string(k + 1);
      trial.observations = observations_[k].get();
      trial.model = models_[k].get();
      problem.trials.push_back(std::move(trial));
    }
    correlate::FitOptions options;
    options.workers = 1;
    options.profile.wanted = false;
    options.search.screened = 0;
    return FindTrialsApart(problem, options, correlate::Fit(problem, options));
  }

 private:
  std::vector<std::unique_ptr<Swing>> models_;
  std::vector<std::unique_ptr<correlate::Observations>> observations_;
};

TEST(TrialsApart, NoneWhereAllAreExplained) {
  Trials all;
  for (const double offset : {0.3, 0.45, 0.2}) all.Add(offset, 0.0, {});
  const TrialsApart apart = all.Find();
  EXPECT_EQ(apart.verdict, "");
  EXPECT_TRUE(apart.reasons.empty());
}

TEST(TrialsApart, AnOffsetThatIsSaidWrongly) {
  Trials all;
  all.Add(0.3, 0.0, {});
  all.Add(0.45, 0.0, correlate::Prior::Known(0.55));
  const TrialsApart apart = all.Find();
  EXPECT_EQ(apart.verdict, "the data of trial 2 beside the others'");
  EXPECT_THAT(apart.reasons, ElementsAre(HasSubstr("at the release, where 0.55 s was said")));
}

TEST(TrialsApart, AClockThatRunsFast) {
  Trials all;
  all.Add(0.3, 0.0, {});
  all.Add(0.45, 0.01, {});
  EXPECT_THAT(all.Find().reasons,
              ElementsAre(::testing::AllOf(HasSubstr("one of trial 1 that runs slow by"),
                                           HasSubstr("one of trial 2 that runs fast by"),
                                           HasSubstr("Which of the two"))));
  all.Add(0.2, 0.0, {});
  const TrialsApart apart = all.Find();
  EXPECT_EQ(apart.verdict, "the data of trial 2 beside the others'");
  EXPECT_THAT(apart.reasons, ElementsAre(HasSubstr("With a clock that runs fast by")));
}

// Two marks with one another's names, in one of the trials.
TEST(WhyNotAligned, NamesTheTrialAndTheMarks) {
  const Swing model(0.6);
  std::array<correlate::Observations, 2> data;
  correlate::FitProblem problem;
  problem.parameters.resize(2);
  problem.parameters[0].start = 0.8, problem.parameters[1].start = 0.12;
  for (std::size_t k = 0; k < 2; ++k) {
    Rng rng(k);
    for (const char* name : {"mid", "tip"}) {
      correlate::Stamps stamps;
      stamps.marks = {name};
      stamps.t.resize(1);
      for (double t = 0.0; t < 6.0; t += 0.02) stamps.t[0].push_back(t);
      correlate::MarkSeries m;
      const bool other = k == 1;
      m.name = (name == std::string("mid")) != other ? "mid" : "tip";
      m.t = stamps.t[0];
      m.p = model.Evaluate(Swing::Truth(), stamps).marks[0].p;
      m.cov.setZero(6, m.p.cols());
      m.shared.resize(3, 0);
      for (Eigen::Index i = 0; i < m.p.cols(); ++i) {
        for (double& x : m.p.col(i)) x += 1e-4 * rng.Normal();
        for (const int diagonal : {0, 3, 5}) m.cov(diagonal, i) = 1e-8;
      }
      data[k].marks.push_back(std::move(m));
    }
    problem.trials.push_back({});
    problem.trials[k].name = "trial " + std::to_string(k + 1);
    problem.trials[k].observations = &data[k];
    problem.trials[k].model = &model;
  }
  correlate::FitResult refused;
  refused.status = correlate::FitStatus::kNotAligned;
  EXPECT_THAT(WhyNotAligned(problem, {}, refused),
              ElementsAre(HasSubstr("trial 2"), HasSubstr("exchanged")));
}

}  // namespace
}  // namespace unfurl::study::trials_apart_test
