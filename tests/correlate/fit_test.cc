#include "correlate/fit/fit.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>

#include "base/error.h"
#include "base/statistics.h"
#include "tests/correlate/fit_repeats.h"
#include "tests/correlate/two_link.h"
#include "tests/repeats.h"

namespace unfurl::correlate::fit_test {
namespace {

TEST(Fit, RecoversTheTruthFromAnExactRecord) {
  Trial trial = SparseTrial();
  trial.sigma = 1e-8;
  Rng rng(1);
  const TwoLink model;
  const Observations data = Record(model, TwoLink::Truth(), TwoLink::Marks(), trial, rng);
  FitProblem problem;
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.parameters = TwoLinkParameters();
  problem.trials[0].observations = &data;
  const FitResult fit = Fit(problem);
  ASSERT_TRUE(fit.Usable()) << fit.message;
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_NEAR(fit.parameters[j].value, TwoLink::Truth()[j], 1e-6);
    EXPECT_EQ(fit.parameters[j].verdict, Verdict::kDetermined) << fit.parameters[j].reason;
  }
  EXPECT_NEAR(fit.trials[0].at.offset, trial.offset, 1e-7);
  EXPECT_LT((fit.trials[0].at.X_WM.translation() - trial.X_WM.translation()).norm(), 1e-6);
}

TEST(Fit, CoversWithWhiteNoise) {
  const int seeds = Repeats(30, 200);
  const Coverage c = Repeat(SparseTrial(), seeds, 1000);
  ExpectHonest(c);
  for (const auto& z : c.z) EXPECT_NEAR(Variance(z), 1.0, 4.0 * std::sqrt(2.0 / seeds));
}

TEST(Fit, CoversWithACalibrationErrorCommonToAllSamples) {
  Trial trial = SparseTrial();
  trial.shared_rank = 3;
  trial.shared_size = 1e-3;  // five times a sample's own error
  const Coverage c = Repeat(trial, Repeats(30, 200), 2000);
  ExpectHonest(c);
}

TEST(Fit, CoversWithCorrelatedNoiseWhereWhiteErrorsWouldNot) {
  Trial trial = SparseTrial();
  trial.rho = 0.9;
  const int seeds = Repeats(30, 200);
  const Coverage c = Repeat(trial, seeds, 3000);
  ExpectHonest(c, 0.93, 0.97);  // the correlation is itself estimated from these residuals
  const auto [low, high] = BinomialInterval(static_cast<std::size_t>(c.covered_white[1]),
                                            static_cast<std::size_t>(seeds));
  (void)low;
  EXPECT_LT(high, 0.9);
}

TEST(Fit, WorkersDoNotChangeTheResult) {
  Rng rng(4);
  const TwoLink model;
  const Observations data = Record(model, TwoLink::Truth(), TwoLink::Marks(), SparseTrial(), rng);
  FitProblem problem;
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.trials[0].finer = &model;
  problem.parameters = TwoLinkParameters();
  problem.trials[0].observations = &data;
  FitOptions options;
  options.workers = 1;
  const FitResult one = Fit(problem, options);
  options.workers = 3;
  const FitResult three = Fit(problem, options);
  ASSERT_EQ(one.evaluations.size(), three.evaluations.size());
  for (std::size_t i = 0; i < one.evaluations.size(); ++i) {
    EXPECT_EQ(one.evaluations[i].theta, three.evaluations[i].theta);
    EXPECT_EQ(one.evaluations[i].purpose, three.evaluations[i].purpose);
  }
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_EQ(one.parameters[j].value, three.parameters[j].value);
    EXPECT_EQ(one.parameters[j].sigma, three.parameters[j].sigma);
  }
}

// Frequency is the product of two parameters: no trial tells them apart.
class Product : public TwoLink {
 public:
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    const std::vector<double> two = {theta[0] * theta[1], theta[2]};
    return TwoLink::Evaluate(two, stamps);
  }
};

TEST(Fit, ParametersThatOnlyActTogetherAreNamed) {
  const Product model;
  int named = 0;
  const int seeds = Repeats(5, 20);
  for (int seed = 0; seed < seeds; ++seed) {
    Rng rng(static_cast<std::uint64_t>(seed) + 70);
    const std::vector<double> truth = {0.6, 1.5, 0.35};
    const Observations data = Record(model, truth, TwoLink::Marks(), SparseTrial(), rng);
    FitProblem problem;
    problem.trials.resize(1);
    problem.trials[0].model = &model;
    Parameter a = TwoLinkParameters()[0], b = a, decay = TwoLinkParameters()[1];
    a.name = "stiffness";
    a.start = 0.65;
    a.low = 0.1;
    b.name = "scale";
    b.start = 1.5;
    b.low = 0.1;
    problem.parameters = {a, b, decay};
    problem.trials[0].observations = &data;
    const FitResult fit = Fit(problem);
    ASSERT_TRUE(fit.Usable()) << fit.message;
    const bool both = fit.parameters[0].verdict == Verdict::kCombination &&
                      fit.parameters[1].verdict == Verdict::kCombination;
    named += both && fit.parameters[0].with == std::vector<std::string>{"scale"} ? 1 : 0;
    EXPECT_EQ(fit.parameters[2].verdict, Verdict::kDetermined);
  }
  EXPECT_EQ(named, seeds);
}

TEST(Fit, APriorSettlesWhatTheDataLeaveOpen) {
  const Product model;
  Rng rng(5);
  const std::vector<double> truth = {0.6, 1.5, 0.35};
  const Observations data = Record(model, truth, TwoLink::Marks(), SparseTrial(), rng);
  FitProblem problem;
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  Parameter a = TwoLinkParameters()[0], b = a;
  a.name = "stiffness";
  a.start = 0.65;
  a.low = 0.1;
  b.name = "scale";
  b.start = 1.5;
  b.low = 0.1;
  a.log = b.log = true;
  b.has_prior = true;
  b.prior_mean = 1.52;
  b.prior_sigma = 0.03;
  problem.parameters = {a, b, TwoLinkParameters()[1]};
  problem.trials[0].observations = &data;
  const FitResult fit = Fit(problem);
  ASSERT_TRUE(fit.Usable()) << fit.message;
  // All that is known of it is the prior; the solver stops at a twentieth of a standard error.
  EXPECT_NEAR(fit.parameters[1].value, 1.52, 0.1 * 0.03);
  EXPECT_NEAR(fit.parameters[1].sigma, 0.03, 1e-3);
  EXPECT_NEAR(fit.parameters[0].value * fit.parameters[1].value, 0.9, 1e-3);
  EXPECT_NEAR(fit.parameters[0].sigma, 0.9 / 1.52 * 0.03 / 1.52, 1e-3);
}

TEST(Fit, AParameterAtItsBoundIsSaidToBe) {
  Rng rng(6);
  const TwoLink model;
  const Observations data = Record(model, TwoLink::Truth(), TwoLink::Marks(), SparseTrial(), rng);
  FitProblem problem;
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.parameters = TwoLinkParameters();
  problem.parameters[1].low = 0.45;  // the truth is 0.35
  problem.trials[0].observations = &data;
  const FitResult fit = Fit(problem);
  EXPECT_EQ(fit.parameters[1].verdict, Verdict::kAtBound) << fit.parameters[1].reason;
  EXPECT_DOUBLE_EQ(fit.parameters[1].value, 0.45);
}

// Fails, or throws, in a part of the parameter space and counts its calls.
class Fragile : public TwoLink {
 public:
  double fails_above = 1e9;
  double throws_above = 1e9;
  bool always = false;
  mutable std::atomic<int> calls{0};
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    const int call = ++calls;
    if (theta[0] > throws_above) throw std::runtime_error("the program crashed");
    Prediction out = TwoLink::Evaluate(theta, stamps);
    if (always || (theta[0] > fails_above && call > 1)) {
      out.status = ModelStatus::kFailed;
      out.message = "the step size fell below its limit";
    }
    return out;
  }
};

TEST(Fit, AFailedEvaluationIsRecordedAndNotTheEnd) {
  Rng rng(7);
  for (const bool throws : {false, true}) {
    Fragile model;
    const Observations data = Record(model, TwoLink::Truth(), TwoLink::Marks(), SparseTrial(), rng);
    // The way from the start leads past what fails: forward differences at the start do.
    (throws ? model.throws_above : model.fails_above) = 0.9502;
    FitProblem problem;
    problem.trials.resize(1);
    problem.trials[0].model = &model;
    problem.parameters = TwoLinkParameters();
    problem.trials[0].observations = &data;
    const FitResult fit = Fit(problem);
    ASSERT_TRUE(fit.Usable()) << fit.message;
    EXPECT_NEAR(fit.parameters[0].value, 0.9, 5.0 * fit.parameters[0].sigma);
    int failed = 0;
    for (const EvaluationRecord& e : fit.evaluations) {
      if (e.status == ModelStatus::kFailed) {
        ++failed;
        EXPECT_FALSE(e.message.empty());
      }
    }
    EXPECT_GE(failed, 1);
    EXPECT_EQ(static_cast<int>(fit.evaluations.size()), model.calls.load() - 1);  // less Record's
  }
}

TEST(Fit, AModelThatAlwaysFailsIsAStatus) {
  Rng rng(8);
  const Observations data =
      Record(TwoLink(), TwoLink::Truth(), TwoLink::Marks(), SparseTrial(), rng);
  Fragile model;
  model.always = true;
  FitProblem problem;
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.parameters = TwoLinkParameters();
  problem.trials[0].observations = &data;
  const FitResult fit = Fit(problem);
  EXPECT_EQ(fit.status, FitStatus::kModelFailed);
  EXPECT_NE(fit.message.find("step size"), std::string::npos);
}

TEST(Fit, DataOfSomethingElseAreRefused) {
  Rng rng(9);
  const TwoLink model;
  Observations data = Record(model, TwoLink::Truth(), TwoLink::Marks(), SparseTrial(), rng);
  for (MarkSeries& m : data.marks) {
    for (Eigen::Index i = 0; i < m.p.cols(); ++i) m.p(0, i) += 3.0 * rng.Normal();
  }
  FitProblem problem;
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.parameters = TwoLinkParameters();
  problem.trials[0].observations = &data;
  EXPECT_EQ(Fit(problem).status, FitStatus::kNotAligned);
}

TEST(Fit, BadParametersAreErrors) {
  FitProblem problem;
  const TwoLink model;
  Observations data;
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.trials[0].observations = &data;
  EXPECT_THROW(Fit(problem), Error);
  problem.parameters = TwoLinkParameters();
  problem.parameters[0].start = 9.0;
  EXPECT_THROW(Fit(problem), Error);
  problem.parameters = TwoLinkParameters();
  problem.parameters[1].low = -1.0;  // of a logarithm
  EXPECT_THROW(Fit(problem), Error);
}

// A coarse model: its frequencies are off by a part that falls with the square of the spacing, as
// those of finite segments do.
class Coarse : public TwoLink {
 public:
  explicit Coarse(double spacing) : spacing_(spacing) {}
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    const double part = 1.0 - 0.004 * spacing_ * spacing_;
    const std::vector<double> two = {theta[0] * part, theta[1] * (1.0 + 2.0 * (1.0 - part))};
    return TwoLink::Evaluate(two, stamps);
  }

 private:
  double spacing_;
};

TEST(Fit, TheModelsOwnErrorEntersTheStandardErrors) {
  Rng rng(10);
  const Observations data =
      Record(TwoLink(), TwoLink::Truth(), TwoLink::Marks(), SparseTrial(), rng);
  const Coarse coarse(1.0), finer(0.5);
  FitProblem problem;
  problem.trials.resize(1);
  problem.trials[0].model = &coarse;
  problem.trials[0].finer = &finer;
  problem.parameters = TwoLinkParameters();
  problem.trials[0].observations = &data;
  const FitResult fit = Fit(problem);
  ASSERT_TRUE(fit.Usable());
  const ParameterEstimate& frequency = fit.parameters[0];
  EXPECT_EQ(frequency.verdict, Verdict::kMeshLimited);
  EXPECT_GT(fit.trials[0].model_error_sigmas, 1.0);
  // The estimate is off by the model's error, here 0.4%; the finer model tells by how much, and
  // the standard error owns up to it where the data alone would deny it.
  const double error = frequency.value - TwoLink::Truth()[0];
  EXPECT_NEAR(error, 0.0036, 2e-4);
  EXPECT_NEAR(frequency.model_shift, -error, 0.1 * std::abs(error));
  EXPECT_LT(std::abs(error), 2.0 * frequency.sigma);
  EXPECT_GT(std::abs(error), 5.0 * frequency.sigma_white);
}

TEST(Fit, AGrowingHorizonWidensTheBasin) {
  // Half a turn of phase or more at the end of the record is a wrong minimum for the whole record.
  Trial trial = SparseTrial();
  trial.duration = 8.0;
  Rng rng(11);
  const TwoLink model;
  std::vector<double> truth = {1.3, 0.1};
  const Observations data = Record(model, truth, TwoLink::Marks(), trial, rng);
  FitProblem problem;
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.parameters = TwoLinkParameters();
  problem.parameters[0].start = 1.2;
  problem.parameters[1].start = 0.1;
  problem.trials[0].observations = &data;
  FitOptions options;
  options.stages = {1.0, 2.5};
  const FitResult fit = Fit(problem, options);
  ASSERT_TRUE(fit.Usable()) << fit.message;
  EXPECT_EQ(fit.stages.size(), 4u);  // the whole record twice: to lead, and sharpened
  EXPECT_NEAR(fit.parameters[0].value, truth[0], 4.0 * fit.parameters[0].sigma);
  // Without stages the same start leads to another swing, from where the look at other offsets
  // leads back.
  const FitResult whole = Fit(problem);
  ASSERT_TRUE(whole.Usable()) << whole.message;
  EXPECT_NEAR(whole.parameters[0].value, truth[0], 4.0 * whole.parameters[0].sigma);
}

}  // namespace
}  // namespace unfurl::correlate::fit_test
