#include "correlate/fit/command_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "correlate/sampled_model.h"
#include "tests/correlate/fit_repeats.h"
#include "tests/correlate/two_link.h"

namespace unfurl::correlate::command_model_test {
namespace {

using ::testing::HasSubstr;

// A swing that decays, written by awk: someone's own program.
constexpr char kProgram[] = R"(BEGIN {
  f = {{frequency}}; d = {{decay}}; fails = {{fails}};
  if (fails > 0 && int(f * 1e7) % fails == 0) { print "gave up" > "/dev/stderr"; exit 3 }
  print "t [s],base.x [m],base.y [m],tip.x [m],tip.y [m]";
  pi = atan2(0, -1);
  for (i = 0; i <= 1600; ++i) {
    t = i / 500; q = 1.2 * exp(-d * t) * cos(2 * pi * f * t); s = 0.3 * sin(2.1 * t);
    printf "%.17g,%.17g,%.17g,%.17g,%.17g\n", t, 0.2 * cos(s), 0.2 * sin(s), \
      0.2 * cos(s) + 0.8 * cos(q), 0.2 * sin(s) + 0.8 * sin(q);
  }
})";

class CommandModelTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        std::filesystem::temp_directory_path() / ("unfurl_command_" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
    std::ofstream(folder_ / "swing.awk") << kProgram;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  CommandModelOptions Options() const {
    CommandModelOptions options;
    options.parameters = {"frequency", "decay", "fails"};
    options.words = {"sh", "-c", "awk -f swing.awk > out.csv"};
    options.files = {(folder_ / "swing.awk").string()};
    options.tracks = "out.csv";
    options.study_folder = folder_.string();
    return options;
  }
  static Stamps SomeStamps() { return {{"tip", "base"}, {{-0.1, 0.0, 0.5, 1.2345}, {0.7}}}; }
  std::filesystem::path folder_;
};

TEST_F(CommandModelTest, AnswersAtTheStampsAsked) {
  const CommandModel model(Options());
  const std::vector<double> theta = {0.9, 0.35, 0.0};
  const Prediction p = model.Evaluate(theta, SomeStamps());
  ASSERT_EQ(p.status, ModelStatus::kGood) << p.message;
  auto tip = [&](double t) {
    const double q = 1.2 * std::exp(-0.35 * t) * std::cos(2.0 * std::numbers::pi * 0.9 * t);
    const double s = 0.3 * std::sin(2.1 * t);
    return Eigen::Vector3d(0.2 * std::cos(s) + 0.8 * std::cos(q),
                           0.2 * std::sin(s) + 0.8 * std::sin(q), 0.0);
  };
  constexpr double kInterpolated = 1e-8;  // cubic over 2 ms of a motion of some hertz [m]
  EXPECT_LT((p.marks[0].p.col(0) - tip(0.0)).norm(), kInterpolated);  // held before its start
  EXPECT_LT((p.marks[0].p.col(2) - tip(0.5)).norm(), kInterpolated);
  EXPECT_LT((p.marks[0].p.col(3) - tip(1.2345)).norm(), kInterpolated);
  EXPECT_NEAR(p.marks[0].v(0, 3), (tip(1.2346).x() - tip(1.2344).x()) / 2e-4, 1e-4);
}

TEST_F(CommandModelTest, FailuresAreAnswersInWords) {
  const std::vector<double> theta = {0.9, 0.35, 1.0};  // fails always
  Prediction p = CommandModel(Options()).Evaluate(theta, SomeStamps());
  EXPECT_EQ(p.status, ModelStatus::kFailed);
  EXPECT_THAT(p.message, HasSubstr("exit code 3: gave up"));

  CommandModelOptions absent = Options();
  absent.words = {"no-such-program-anywhere"};
  p = CommandModel(absent).Evaluate(theta, SomeStamps());
  EXPECT_THAT(p.message, HasSubstr("does not start"));

  CommandModelOptions slow = Options();
  slow.words = {"sh", "-c", "sleep 20"};
  slow.timeout = 0.2;
  p = CommandModel(slow).Evaluate(theta, SomeStamps());
  EXPECT_THAT(p.message, HasSubstr("not done in 0.2 s"));

  CommandModelOptions silent = Options();
  silent.words = {"true"};
  p = CommandModel(silent).Evaluate(theta, SomeStamps());
  EXPECT_THAT(p.message, HasSubstr("out.csv"));
  EXPECT_THAT(p.message, ::testing::Not(HasSubstr("/unfurl-")));  // the same words each time
}

TEST_F(CommandModelTest, AnUnknownPlaceholderIsAnError) {
  CommandModelOptions options = Options();
  options.words = {"model", "--f={frequncy}"};
  EXPECT_THROW(CommandModel{options}, Error);
}

// The same fit with a program that now and then fails.
TEST_F(CommandModelTest, VerdictsStandWhenItFailsNowAndThen) {
  Rng rng(31);
  const CommandModel good(Options());
  const std::vector<double> truth = {0.9, 0.35, 0.0};
  const Observations data = Record(good, truth, {"base", "tip"}, SparseTrial(), rng);
  std::vector<FitResult> fits;
  std::vector<int> failed;
  for (const double fails : {0.0, 7.0}) {
    CommandModelOptions options = Options();
    options.parameters = {"frequency", "decay"};
    std::string text = kProgram;
    text.replace(text.find("{{fails}}"), 9, std::to_string(fails));
    std::ofstream(folder_ / "swing.awk") << text;
    const CommandModel model(options);
    FitProblem problem;
    problem.parameters = TwoLinkParameters();
    problem.trials.resize(1);
    problem.trials[0].model = &model;
    problem.trials[0].observations = &data;
    fits.push_back(Fit(problem));
    ASSERT_TRUE(fits.back().Usable()) << fits.back().message;
    failed.push_back(0);
    for (const EvaluationRecord& e : fits.back().evaluations) {
      // A way from an earlier offset, start 1 and on, asks for more than the program writes.
      failed.back() += e.status == ModelStatus::kFailed && e.start < 1 ? 1 : 0;
    }
  }
  EXPECT_EQ(failed[0], 0);
  EXPECT_GT(failed[1], 0);
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_EQ(fits[1].parameters[j].verdict, fits[0].parameters[j].verdict);
    // Two steps of less than a standard error that lead nowhere, as into what fails, end the
    // search: that is how near it must come.
    EXPECT_NEAR(fits[1].parameters[j].value, fits[0].parameters[j].value,
                fits[0].parameters[j].sigma);
    EXPECT_NEAR(fits[0].parameters[j].value, truth[j], 4.0 * fits[0].parameters[j].sigma);
  }
}

}  // namespace
}  // namespace unfurl::correlate::command_model_test
