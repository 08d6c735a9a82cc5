// Evaluations of a fit through a folder: the answers of threads, whatever becomes of workers.
#include "campaign/folder_workers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <thread>

#include "base/error.h"
#include "correlate/fit/evaluation_store.h"
#include "tests/own_folder.h"

namespace unfurl::campaign::folder_workers_test {
namespace {

using correlate::Fidelity;
using correlate::Job;
using correlate::Prediction;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

// One mark and one quantity, of irrational values; fails where theta is negative.
class Curve : public correlate::Model {
 public:
  explicit Curve(double scale) : scale_(scale) {}
  Prediction Evaluate(std::span<const double> theta, const correlate::Stamps& s) const override {
    Prediction out;
    if (theta[0] < 0.0) {
      out.status = correlate::ModelStatus::kFailed;
      out.message = "negative";
      return out;
    }
    for (const std::vector<double>& t : s.t) {
      correlate::MarkMotion motion;
      const auto n = static_cast<Eigen::Index>(t.size());
      motion.p.setZero(3, n);
      motion.v.setZero(3, n);
      for (Eigen::Index i = 0; i < n; ++i) {
        motion.p(0, i) = scale_ * std::sin(theta[0] * t[static_cast<std::size_t>(i)]);
        motion.v(1, i) = std::exp(-theta[0]);
      }
      out.marks.push_back(motion);
    }
    for (const correlate::QuantityStamps& q : s.quantities) {
      out.quantities.push_back({q.key, Eigen::VectorXd::Constant(
                                           static_cast<Eigen::Index>(q.t.size()), theta[0] / 3)});
    }
    out.events = {{std::sqrt(theta[0]), "latch", "hinge"}};
    return out;
  }

 private:
  double scale_;
};

class FolderWorkersTest : public ::testing::Test {
 protected:
  void SetUp() override {
    problem_.trials.resize(2);
    for (std::size_t i = 0; i < 2; ++i) problem_.trials[i].model = &models_[i];
    problem_.trials[1].rungs = {{&models_[2], "fine", 0.0}};
    for (std::size_t i = 0; i < 6; ++i) {
      const std::size_t trial = i % 2;
      const Fidelity fidelity = i == 3 ? Fidelity::kRung : Fidelity::kMain;
      jobs_.push_back({trial, fidelity,
                       correlate::ModelOf(problem_.trials[trial], fidelity),
                       {i == 4 ? -1.0 : 0.1 + 0.7 * static_cast<double>(i)},
                       &stamps_[i % 2]});
    }
  }
  EvaluationFolder Made() const { return EvaluationFolder::Make(folder_.File("q"), "one"); }
  EvaluationFolder Opened() const { return EvaluationFolder::Open(folder_.File("q"), "one"); }
  static std::vector<std::string> Answers(correlate::Workers& workers, std::span<const Job> jobs) {
    std::vector<std::string> out(jobs.size());
    workers.Run(jobs, [&](std::size_t i, Prediction p) { out[i] = correlate::AnswerBytes(p); });
    return out;
  }
  std::vector<std::string> Expected() const {
    return Answers(*correlate::LocalWorkers(1), jobs_);
  }
  static std::string ErrorOf(const std::function<void()>& call) {
    try {
      call();
    } catch (const Error& e) {
      return e.what();
    }
    return "none";
  }
  // As if nobody had touched what is being answered for an hour.
  void Age() const {
    for (const auto& file : fs::directory_iterator(folder_.path() / "q" / "taken")) {
      fs::last_write_time(file, fs::file_time_type::clock::now() - std::chrono::hours(1));
    }
  }

  OwnFolder folder_;
  Curve models_[3] = {Curve(1.0), Curve(0.3), Curve(7.0)};
  correlate::Stamps stamps_[2] = {
      {{"a", "b"}, {{-0.1, 0.0, 1.0 / 3.0}, {0.5}}, {}},
      {{"c"}, {{0.1}}, {{"gyro", "hinge.omega", {0.25, 0.75}, 0.5}}}};
  correlate::FitProblem problem_;
  std::vector<Job> jobs_;
};

TEST_F(FolderWorkersTest, GiveTheBitsOfThreads) {
  FolderWorkers workers(Made(), {&problem_}, nullptr);
  std::thread server([&] { ServeEvaluations(Opened(), {&problem_}, 2); });
  EXPECT_EQ(Answers(workers, jobs_), Expected());
  EXPECT_EQ(workers.answers(), jobs_.size());
  Opened().Close(false);
  server.join();
  EXPECT_FALSE(fs::exists(folder_.File("q")));
}

TEST_F(FolderWorkersTest, AProblemIsKnownByItsModels) {
  // Of trials that are fitted one by one.
  const Curve other(2.0);
  correlate::FitProblem first;
  first.trials.resize(1);
  first.trials[0].model = &other;
  FolderWorkers workers(Made(), {&first, &problem_}, nullptr);
  std::thread server([&] { ServeEvaluations(Opened(), {&first, &problem_}, 1); });
  EXPECT_EQ(Answers(workers, jobs_), Expected());
  Opened().Close(false);
  server.join();
}

TEST_F(FolderWorkersTest, WhatADeadWorkerHadIsAskedAgain) {
  FolderWorkers workers(Made(), {&problem_}, nullptr);
  std::thread server([&] {
    const EvaluationFolder folder = Opened();
    std::uint64_t question = 0;
    std::string bytes;
    while (!folder.Take("dead", &question, &bytes)) std::this_thread::yield();
    Age();
    ServeEvaluations(folder, {&problem_}, 1);
  });
  EXPECT_EQ(Answers(workers, jobs_), Expected());
  Opened().Close(false);
  server.join();
}

TEST_F(FolderWorkersTest, WhatKillsItsWorkersEndsTheFit) {
  FolderWorkers workers(Made(), {&problem_}, nullptr);
  std::atomic<bool> ended = false;
  std::thread deaths([&] {
    const EvaluationFolder folder = Opened();
    std::uint64_t question = 0;
    std::string bytes;
    while (!ended) {
      if (folder.Take("dead", &question, &bytes)) Age();
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  });
  const std::span<const Job> one(jobs_.data(), 1);
  EXPECT_THAT(ErrorOf([&] { Answers(workers, one); }), HasSubstr("workers died"));
  ended = true;
  deaths.join();
}

TEST_F(FolderWorkersTest, AnswersToAnotherQuestionAreNone) {
  FolderWorkers workers(Made(), {&problem_}, nullptr);
  std::thread server([&] {
    const EvaluationFolder folder = Opened();
    std::uint64_t question = 0;
    std::string bytes;
    while (!folder.Take("late", &question, &bytes)) std::this_thread::yield();
    // Whole, of this number, and of an earlier fit: 1 s, and a checksum of other bytes.
    const std::uint64_t sum = 12345;
    const double seconds = 1.0;
    std::string answer(reinterpret_cast<const char*>(&sum), sizeof sum);
    answer.append(reinterpret_cast<const char*>(&seconds), sizeof seconds);
    folder.Answer("late", question,
                  answer + correlate::AnswerBytes(models_[1].Evaluate(std::vector<double>{0.5},
                                                                      stamps_[0])));
    ServeEvaluations(folder, {&problem_}, 1);
  });
  EXPECT_EQ(Answers(workers, jobs_), Expected());
  Opened().Close(false);
  server.join();
}

TEST_F(FolderWorkersTest, ADamagedAnswerIsSaid) {
  FolderWorkers workers(Made(), {&problem_}, nullptr);
  std::thread server([&] {
    const EvaluationFolder folder = Opened();
    std::uint64_t question = 0;
    std::string bytes;
    while (!folder.Take("bad", &question, &bytes)) std::this_thread::yield();
    folder.Answer("bad", question, "what is this");
    const fs::directory_iterator answer(folder.path() + "/answers");
    if (answer == fs::directory_iterator()) return;  // it was read before it could be damaged
    std::fstream(answer->path(), std::ios::in | std::ios::out | std::ios::binary).write("x", 1);
  });
  const std::string error = ErrorOf([&] { Answers(workers, jobs_); });
  EXPECT_TRUE(error.find("is damaged") != std::string::npos ||
              error.find("is none") != std::string::npos)
      << error;
  server.join();
}

TEST_F(FolderWorkersTest, FoldersOfOthersAreLeftAlone) {
  const EvaluationFolder first = Made();
  EXPECT_THAT(ErrorOf([&] { Made(); }), HasSubstr("in use by another fit"));
  EXPECT_THAT(ErrorOf([&] { EvaluationFolder::Open(folder_.File("q"), "two"); }),
              HasSubstr("another study"));
  EXPECT_THAT(ErrorOf([&] { EvaluationFolder::Open(folder_.File("none"), "one"); }),
              HasSubstr("holds no questions"));
  fs::create_directories(folder_.path() / "mine");
  folder_.Put("mine/thesis.tex", "years of work");
  EXPECT_THAT(ErrorOf([&] { EvaluationFolder::Make(folder_.File("mine"), "one"); }),
              HasSubstr("thesis.tex"));
  EXPECT_EQ(folder_.Get("mine/thesis.tex"), "years of work");
  // A file; a link to one; a folder whose files only look like ours; another program's fit.json.
  EXPECT_THAT(ErrorOf([&] { EvaluationFolder::Make(folder_.File("mine/thesis.tex"), "one"); }),
              HasSubstr("no folder"));
  fs::create_symlink(folder_.File("mine/thesis.tex"), folder_.File("link"));
  EXPECT_THAT(ErrorOf([&] { EvaluationFolder::Make(folder_.File("link"), "one"); }),
              HasSubstr("no folder"));
  fs::create_directories(folder_.path() / "logs");
  folder_.Put("logs/log-book", "of a ship");
  EXPECT_THAT(ErrorOf([&] { EvaluationFolder::Make(folder_.File("logs"), "one"); }),
              HasSubstr("no questions of a fit"));
  folder_.Put("logs/fit.json", "{\"theta\": 1}");
  EXPECT_THAT(ErrorOf([&] { EvaluationFolder::Make(folder_.File("logs"), "one"); }),
              HasSubstr("does not say"));
  EXPECT_EQ(folder_.Get("mine/thesis.tex"), "years of work");
  EXPECT_EQ(folder_.Get("logs/log-book"), "of a ship");
  EXPECT_EQ(folder_.Get("logs/fit.json"), "{\"theta\": 1}");
}

// What its workers said is kept where a fit failed, and goes with the next one.
TEST_F(FolderWorkersTest, LogsStayWhereAFitFailed) {
  {
    const EvaluationFolder failed = Made();
    std::ofstream(failed.LogPath("1")) << "out of memory";
    failed.Close(true);
  }
  EXPECT_EQ(folder_.Get("q/log-1"), "out of memory");
  Made().Close(false);
  EXPECT_FALSE(fs::exists(folder_.File("q")));
}

TEST_F(FolderWorkersTest, AFolderThatWasLeftIsTakenOver) {
  { const EvaluationFolder killed = Made(); }
  const EvaluationFolder again = Made();
  EXPECT_FALSE(again.IsLeft(10.0));
  again.Close(false);
  EXPECT_TRUE(again.IsLeft(10.0));
}

TEST(StoredQuestion, NothingOfItIsLost) {
  const Curve model(1.0);
  const correlate::Stamps stamps = {
      {"a", ""}, {{-0.0, 1e-300}, {}}, {{"k", "q", {1.0}, std::nextafter(2.0, 3.0)}}};
  const Job job{3, correlate::FidelityOfRung(2), &model, {std::nextafter(0.1, 1.0)}, &stamps};
  const std::string bytes = correlate::WholeQuestionBytes(job);
  correlate::StoredQuestion back;
  ASSERT_TRUE(correlate::ParseQuestion(bytes, &back));
  EXPECT_EQ(correlate::WholeQuestionBytes({back.trial, back.fidelity, &model, back.theta,
                                           &back.stamps}),
            bytes);
  EXPECT_EQ(back.stamps.quantities.at(0).needed, std::nextafter(2.0, 3.0));
  // Cut anywhere, or longer: none.
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    correlate::StoredQuestion cut;
    EXPECT_FALSE(correlate::ParseQuestion(std::string_view(bytes).substr(0, n), &cut)) << n;
  }
  EXPECT_FALSE(correlate::ParseQuestion(bytes + "x", &back));
}

}  // namespace
}  // namespace unfurl::campaign::folder_workers_test
