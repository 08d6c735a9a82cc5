#include "study/repeat.h"

#include <gmock/gmock.h>

#include <filesystem>

#include "tests/study/arm.h"

namespace unfurl::study::repeat_test {
namespace {

using ::testing::HasSubstr;

// Five swings of an arm whose damping differs from swing to swing and whose gravity does not.
class RepeatTest : public ArmTest {
 protected:
  static constexpr double kDamping[] = {0.016, 0.024, 0.020, 0.013, 0.028};

  data::Study Trials(std::size_t count, const std::string& more = "[repeat]\n") const {
    std::string text =
        "[study]\nscene = \"arm.toml\"\n[profile]\nlevels = []\n"
        "[parameter.damping]\nkeys = [\"joint.hinge.damper.damping\"]\nstart = 0.02\n"
        "bounds = [0.001, 0.2]\ntransform = \"log\"\nunit = \"N m s/rad\"\n"
        "[parameter.gravity]\nkeys = [\"gravity.acceleration[1]\"]\nstart = -9.8\n"
        "bounds = [-11.0, -9.0]\n" +
        more;
    for (std::size_t i = 0; i < count; ++i) {
      const std::string file = fmt::format("swing{}.csv", i);
      Record(file, {"mid", "tip", ""}, {fmt::format("joint.hinge.damper.damping={}", kDamping[i])},
             100 + i);
      text += fmt::format("[[trial]]\ntracks = \"{}\"\noffset = 0.0\nframe = \"known\"\n", file);
    }
    return data::ReadStudy(Put("swings.toml", text));
  }
};

TEST_F(RepeatTest, FindsWhatScattersAndWhatDoesNot) {
  const std::string file = (folder_ / "swings.h5").string();
  FitStudyOptions options;
  options.output = file;
  const RepeatFit fit = FitRepeat(Trials(5), options);
  ASSERT_TRUE(fit.Usable());
  const auto& damping = fit.hierarchy->parameters()[0];
  // Of the planted logarithms: mean -3.94, standard deviation 0.31.
  double mean = 0.0, squares = 0.0;
  for (double d : kDamping) mean += std::log(d) / 5.0;
  for (double d : kDamping) squares += std::pow(std::log(d) - mean, 2) / 4.0;
  EXPECT_NEAR(damping.value, mean, 0.03);
  EXPECT_NEAR(damping.scatter, std::sqrt(squares), 0.03);
  EXPECT_LT(damping.alike_p, 1e-6);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_NEAR(damping.estimate[i], std::log(kDamping[i]), 4.0 * damping.own[i]);
    EXPECT_NEAR(fit.record.repeat.effect(0, static_cast<Eigen::Index>(i)), kDamping[i], 0.002);
  }
  const auto& gravity = fit.record.repeat.parameters[1];
  EXPECT_GT(gravity.alike_p, 0.01);
  EXPECT_EQ(gravity.scatter_low95, 0.0);
  EXPECT_THAT(fit.record.verdict, HasSubstr("not alike: damping differs"));

  // The next swing's marks: a swing of any of these dampings lies in the band nearly always.
  const data::FitRecord::Repeat& r = fit.record.repeat;
  ASSERT_EQ(r.marks.size(), 2u);
  ASSERT_EQ(static_cast<std::size_t>(r.low.cols()), r.t.size());
  EXPECT_TRUE((r.low.array() <= r.high.array()).all());
  SceneModelOptions scene;
  scene.scene = (folder_ / "arm.toml").string();
  scene.keys = {{"joint.hinge.damper.damping"}};
  const std::vector<double> first = {0.02};
  const SceneModel model(scene, first);
  correlate::Stamps stamps;
  stamps.marks = {"tip"};
  stamps.t.resize(1);
  std::vector<Eigen::Index> columns;
  for (std::size_t i = 0; i < r.t.size(); ++i) {
    if (r.marks[static_cast<std::size_t>(r.mark[i])] != "tip") continue;
    stamps.t[0].push_back(r.t[i]);
    columns.push_back(static_cast<Eigen::Index>(i));
  }
  for (double d : kDamping) {
    const Eigen::Matrix3Xd p = model.Evaluate(std::vector<double>{d}, stamps).marks[0].p;
    int inside = 0;
    for (std::size_t i = 0; i < columns.size(); ++i) {
      constexpr double kNoise = 1e-4;  // the band is thinner than the fit's errors at the start [m]
      inside += p(0, static_cast<Eigen::Index>(i)) > r.low(0, columns[i]) - kNoise &&
                p(0, static_cast<Eigen::Index>(i)) < r.high(0, columns[i]) + kNoise;
    }
    EXPECT_GT(inside, 0.9 * static_cast<double>(columns.size())) << d;
  }

  // The file holds the same.
  const data::FitRecord read = data::ReadFit(file);
  EXPECT_EQ(read.repeat.trials, r.trials);
  EXPECT_TRUE(read.repeat.effect.isApprox(r.effect, 0.0));
  EXPECT_TRUE(read.repeat.low.isApprox(r.low, 0.0));
  EXPECT_EQ(read.repeat.parameters[0].scatter_high95, r.parameters[0].scatter_high95);
  EXPECT_EQ(read.t.size(), fit.record.t.size());
  for (int i = 1; i <= 5; ++i) {
    EXPECT_FALSE(std::filesystem::exists(fmt::format("{}.trial-{}.partial", file, i)));
  }
}

TEST_F(RepeatTest, HoldsTheParametersThatAreNotNamed) {
  const RepeatFit fit = FitRepeat(Trials(3, "[repeat]\nparameters = [\"damping\"]\n"));
  ASSERT_TRUE(fit.Usable());
  EXPECT_TRUE(fit.hierarchy->parameters()[0].scatters);
  const auto& gravity = fit.record.parameters[1];
  EXPECT_EQ(gravity.verdict, "one value");
  EXPECT_LT(gravity.low95, -9.81);
  EXPECT_GT(gravity.high95, -9.81);
}

TEST_F(RepeatTest, LeavesOutATrialThatSaysNothing) {
  data::Study study = Trials(4);
  // A window in which the arm has hardly moved.
  study.trials[1].window_low = 0.0, study.trials[1].window_high = 0.05;
  const RepeatFit fit = FitRepeat(study);
  ASSERT_TRUE(fit.Usable());
  EXPECT_EQ(fit.record.repeat.trials.size(), 3u);
  EXPECT_THAT(fit.record.reasons.front(), HasSubstr("trial 2 is left out"));
}

TEST_F(RepeatTest, RefusesTwoTrials) {
  try {
    FitRepeat(Trials(2));
    FAIL() << "two trials";
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), HasSubstr("the scatter of 2 trials"));
    EXPECT_THAT(e.what(), HasSubstr("repeat"));
  }
  EXPECT_THROW(Trials(3, "[repeat]\nparameters = [\"dampin\"]\n"), Error);
  EXPECT_THROW(Trials(3, "[repeat]\nparameter = [\"damping\"]\n"), Error);
}

}  // namespace
}  // namespace unfurl::study::repeat_test
