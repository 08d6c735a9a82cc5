// Channels in another unit than stated, on a pendulum whose small swings are known in closed form.
#include "study/channel_unit_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/error.h"
#include "study/trial_observations.h"
#include "tests/study/swing.h"

namespace unfurl::study::channel_unit_check_test {
namespace {

using ::testing::HasSubstr;

class ChannelUnit : public SwingTest {
 protected:
  // What the check says of a swing of 0.2 rad, damped to half in ten seconds, of 5% noise, whose
  // times and readings are multiplied; empty: nothing.
  std::string Words(double times, double readings, const std::string& channel = "",
                    double start = 0.25, double most = 1.0) const {
    // An arm of 1 m about its end: w^2 = m g l / (2 I) = 1.5 g / l.
    const double w = std::sqrt(1.5 * 9.81);
    Rng rng(3);
    std::string text = "t [s],angle [rad]\n";
    for (int i = 0; i < 600; ++i) {
      const double t = 0.01 * i;
      const double angle = 0.2 * std::exp2(-t / 10.0) * std::cos(w * t) + 0.003 * rng.Normal();
      text += fmt::format("{:.9g},{:.9g}\n", times * t, readings * angle);
    }
    Put("angle.csv", text);
    Put("scene.toml", Scene(Laws{.linear = 0.05}));
    const data::Study study = data::ReadStudy(
        Put("study.toml",
            "[study]\nscene = \"scene.toml\"\n[trial]\noffset = 0.0\n[trial.channel.angle]\n"
            "file = \"angle.csv\"\nquantity = \"hinge.theta\"\n" +
                channel +
                fmt::format("[parameter.start]\nkeys = [\"joint.hinge.theta\"]\nstart = {}\n"
                            "bounds = [0.001, {}]\n",
                            start, most)));
    SceneModelOptions options;
    options.scene = study.scene;
    options.keys = {study.parameters[0].keys};
    const std::vector<double> theta = {study.parameters[0].start};
    const SceneModel model(options, theta);
    correlate::Observations observations;
    AddChannels(study.trials[0], &model.quantities(), &observations);
    try {
      RefuseOtherChannelUnits(study.trials[0], study.parameters, observations, model, theta);
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  }
};

TEST_F(ChannelUnit, TimesInOtherUnitsAreNamed) {
  EXPECT_THAT(Words(1e3, 1.0), HasSubstr("milliseconds"));
  EXPECT_THAT(Words(1e6, 1.0), HasSubstr("microseconds"));
  EXPECT_THAT(Words(1.0 / 60.0, 1.0), HasSubstr("minutes"));
  EXPECT_THAT(Words(1e3, 1.0), HasSubstr("'t [ms]'"));
}

TEST_F(ChannelUnit, ReadingsInOtherUnitsAreNamed) {
  constexpr double kDegree = 180.0 / std::numbers::pi;
  EXPECT_THAT(Words(1.0, kDegree), HasSubstr("degrees"));
  EXPECT_THAT(Words(1.0, kDegree), HasSubstr("trial.channel.angle"));
  EXPECT_THAT(Words(1.0, 1e3), HasSubstr("thousandths"));
}

TEST_F(ChannelUnit, OrdinaryRecordsAreNot) {
  constexpr double kDegree = 180.0 / std::numbers::pi;
  EXPECT_EQ(Words(1.0, 1.0), "");
  // Where the gain is to be found, or a parameter's bound lies there, it is no question of units.
  EXPECT_EQ(Words(1.0, kDegree, "gain = \"free\"\n"), "");
  EXPECT_EQ(Words(1.0, 1.0, "", 0.004), "");
  for (const double off : {0.2, 0.5, 2.0, 5.0}) {
    EXPECT_EQ(Words(off, 1.0), "") << off;
    EXPECT_EQ(Words(1.0, off), "") << off;
  }
}

}  // namespace
}  // namespace unfurl::study::channel_unit_check_test
