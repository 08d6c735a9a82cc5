// A fit that was stopped anywhere and resumed, and what a journal of evaluations keeps.
#include <gtest/gtest.h>


#include "correlate/fit/evaluation_store.h"
#include "tests/correlate/fit_repeats.h"
#include "tests/correlate/stopped_workers.h"
#include "tests/correlate/two_link.h"
#include "tests/own_folder.h"

namespace unfurl::correlate::resume_test {
namespace {

// Fails in a part of its range.
class Patchy : public TwoLink {
 public:
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Prediction out = TwoLink::Evaluate(theta, stamps);
    if (theta[0] > 0.9502 && theta[0] < 0.96) {
      out.status = ModelStatus::kFailed;
      out.message = "the step size fell below its limit";
    }
    return out;
  }
};

void ExpectSame(const FitResult& a, const FitResult& b) {
  ASSERT_EQ(a.status, b.status);
  ASSERT_EQ(a.evaluations.size(), b.evaluations.size());
  for (std::size_t i = 0; i < a.evaluations.size(); ++i) {
    EXPECT_EQ(a.evaluations[i].theta, b.evaluations[i].theta);
    EXPECT_EQ(a.evaluations[i].cost, b.evaluations[i].cost);
    EXPECT_EQ(a.evaluations[i].message, b.evaluations[i].message);
    EXPECT_EQ(a.evaluations[i].start, b.evaluations[i].start);
  }
  for (std::size_t j = 0; j < a.parameters.size(); ++j) {
    EXPECT_EQ(a.parameters[j].value, b.parameters[j].value);
    EXPECT_EQ(a.parameters[j].sigma, b.parameters[j].sigma);
    EXPECT_EQ(a.parameters[j].profile.low, b.parameters[j].profile.low);
    EXPECT_EQ(a.parameters[j].reason, b.parameters[j].reason);
  }
  EXPECT_EQ(a.covariance, b.covariance);
}

TEST(Resume, AfterAnyEvaluationGivesTheSameBits) {
  const OwnFolder folder;
  const std::string result = folder.File("fit.h5");
  const Patchy model;
  Rng rng(4);
  const Observations data =
      Record(TwoLink(), TwoLink::Truth(), TwoLink::Marks(), SparseTrial(), rng);
  FitProblem problem;
  problem.parameters = TwoLinkParameters();
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.trials[0].finer = &model;
  problem.trials[0].observations = &data;
  FitOptions options;
  options.search.screened = 6;
  options.search.starts = 2;
  const FitResult whole = Fit(problem, options);
  ASSERT_TRUE(whole.Usable()) << whole.message;
  EXPECT_EQ(whole.starts.size(), 2u);
  const int count = static_cast<int>(whole.evaluations.size());

  const auto threads = LocalWorkers(2);
  for (int stop = 0; stop < count; stop += 7) {
    {
      data::Journal journal(result, "same", false);
      Stopped stopped(*threads, stop);
      JournaledWorkers workers(stopped, journal);
      options.where = &workers;
      EXPECT_THROW(Fit(problem, options), Interrupted);
    }
    data::Journal journal(result, "same", true);
    EXPECT_EQ(journal.found(), static_cast<std::size_t>(stop));
    JournaledWorkers workers(*threads, journal);
    options.where = &workers;
    const FitResult resumed = Fit(problem, options);
    EXPECT_GE(workers.answered(), static_cast<std::size_t>(stop));
    ExpectSame(whole, resumed);
    journal.Remove();
  }
}

TEST(Resume, AnAnswerComesBackToTheLastBit) {
  Prediction p;
  p.status = ModelStatus::kGood;
  p.message = "said";
  p.noise = 1e-7;
  MarkMotion motion;
  motion.p = Eigen::Matrix3Xd::Random(3, 5);
  motion.p.row(2).setZero();
  motion.v = Eigen::Matrix3Xd::Random(3, 5);
  p.marks = {motion, motion};
  p.events = {{0.25, "latch", "joint1"}};
  Prediction q;
  ASSERT_TRUE(ParseAnswer(AnswerBytes(p), &q));
  EXPECT_EQ(q.message, p.message);
  EXPECT_EQ(q.noise, p.noise);
  ASSERT_EQ(q.marks.size(), 2u);
  EXPECT_EQ(q.marks[1].p, motion.p);
  EXPECT_EQ(q.marks[1].v, motion.v);
  EXPECT_EQ(q.events.at(0).where, "joint1");
  const std::string bytes = AnswerBytes(p);
  for (std::size_t cut = 0; cut < bytes.size(); cut += 13) {
    Prediction torn;
    EXPECT_FALSE(ParseAnswer(std::string_view(bytes).substr(0, cut), &torn));
  }
}

}  // namespace
}  // namespace unfurl::correlate::resume_test
