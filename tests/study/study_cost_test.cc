// What the width of a study's intervals costs.
#include "study/study_cost.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "tests/study/arm.h"

namespace unfurl::study::study_cost_test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

const StudyCostPoint& Of(const StudyCost& cost, const std::string& name) {
  for (const StudyCostPoint& p : cost.points) {
    if (p.setting.name == name) return p;
  }
  throw Error("there is no " + name, "test", "");
}

class StudyCostTest : public ArmTest {};

TEST_F(StudyCostTest, EachSettingIsAFitOfItsOwn) {
  const std::string path = Study("tracks.csv").path;
  const StudyCost cost = CostOfStudy(path, {}, {});
  ASSERT_TRUE(cost.Usable());
  const StudyCostPoint& first = cost.points[0];
  EXPECT_EQ(first.values[0].shift, 0.0);
  // What is said of a setting is what its options give.
  for (const StudyCostPoint& p : cost.points) {
    ASSERT_TRUE(p.usable) << p.setting.name << ": " << p.message;
    EXPECT_GT(p.seconds, 0.0);
    const StudyFit fit = Fit(data::ReadStudy(path, p.setting.set));
    for (std::size_t j = 0; j < 2; ++j) {
      const correlate::Interval& i = fit.result.parameters[j].all95;
      EXPECT_EQ(p.values[j].value, fit.result.parameters[j].value) << p.setting.name;
      EXPECT_EQ(p.values[j].Half(), 0.5 * (i.high - i.low)) << p.setting.name;
    }
  }
  // The far mark tells four times as much as the middle one; half a record of a decay much less
  // than the whole.
  EXPECT_GT(Of(cost, "without tip").values[0].Half(), 1.5 * first.values[0].Half());
  EXPECT_LT(Of(cost, "without mid").values[0].Half(), 1.3 * first.values[0].Half());
  EXPECT_GT(Of(cost, "the first 50%").values[1].Half(), 2.0 * first.values[1].Half());
  EXPECT_FALSE(Of(cost, "the first 25%").mesh_tested) << "an arm without beams has no mesh";
  EXPECT_TRUE(Of(cost, "no profiles").agrees);
}

// A quarter of the record was a quarter of the marks, beside all of a channel's readings.
TEST_F(StudyCostTest, AHorizonCutsChannelsToo) {
  const std::string whole = Study("tracks.csv").path;
  SceneModelOptions options;
  options.scene = (folder_ / "arm.toml").string();
  options.rtol = 1e-9;
  correlate::Stamps stamps;
  std::vector<double> t;
  for (int i = 1; i <= 400; ++i) t.push_back(0.01 * i);
  stamps.quantities.push_back({"angle", "hinge.theta", t});
  const Eigen::VectorXd angle = SceneModel(options, {}).Evaluate({}, stamps).quantities[0].values;
  Rng rng(3);
  std::string text = "t [s],angle [rad]\n";
  constexpr double kBehind = 0.5;  // the encoder's clock [s]
  for (std::size_t i = 0; i < t.size(); ++i) {
    text += fmt::format("{:.3f},{:.7f}\n", t[i] + kBehind,
                        angle(static_cast<Eigen::Index>(i)) + 1e-3 * rng.Normal());
  }
  Put("angle.csv", text);
  const std::string channel =
      "[trial.channel.angle]\nfile = \"angle.csv\"\nquantity = \"hinge.theta\"\n"
      "sigma = 1e-3\ndelay = 0.5\n";
  const std::string both = data::ReadTextFile(whole) + channel;
  std::string alone = both;
  for (const std::string line : {"tracks = \"tracks.csv\"\n", "frame = \"known\"\n"}) {
    alone.erase(alone.find(line), line.size());
  }
  StudyCostOptions how;
  how.vary = {"horizon"};
  for (const std::string& study : {both, alone}) {
    const StudyCost cost = CostOfStudy(Put("both.toml", study), {}, how);
    ASSERT_TRUE(cost.Usable());
    const StudyCostPoint& half = Of(cost, "the first 50%");
    ASSERT_TRUE(half.usable) << half.message;
    // Of a frequency an eighth of the information, were amplitudes alike.
    EXPECT_GT(half.values[1].Half(), 2.0 * cost.points[0].values[1].Half());
    if (study == both) continue;
    // As of a file that ends there.
    Put("angle.csv", text.substr(0, text.find("2.510,")));
    const StudyFit cut = Fit(data::ReadStudy(Put("cut.toml", study)));
    const correlate::Interval& i = cut.result.parameters[1].all95;
    constexpr double kSame = 1e-6;  // of it
    EXPECT_NEAR(half.values[1].Half(), 0.5 * (i.high - i.low), kSame * half.values[1].Half());
  }
}

TEST_F(StudyCostTest, RungsOfABeamAndTheirTest) {
  const std::string path = BeamStudy().path;
  StudyCostOptions how;
  how.vary = {"rungs"};
  const StudyCost cost = CostOfStudy(path, {}, how);
  ASSERT_TRUE(cost.Usable()) << cost.points[0].message;
  EXPECT_TRUE(cost.points[0].mesh_tested);
  ASSERT_EQ(cost.points.size(), 5U);
  EXPECT_FALSE(Of(cost, "no ladder").mesh_tested);
  EXPECT_FALSE(Of(cost, "no ladder").agrees) << "four segments are not the continuum";
  EXPECT_FALSE(Of(cost, "no ladder").on_front);
  EXPECT_TRUE(Of(cost, "4, 8 segments").agrees);
  EXPECT_GT(Of(cost, "4, 8 segments").values[0].Half(),
            Of(cost, "4, 8, 12 segments").values[0].Half());
  const StudyCostPoint* best = CheapestWithin(cost, 1e3);
  ASSERT_NE(best, nullptr);
  EXPECT_TRUE(best->mesh_tested) << "a narrow interval that nothing tested is no advice";
  EXPECT_THAT(CostAdvice(cost), Contains(HasSubstr("no ladder: its intervals do not meet")));
}

TEST_F(StudyCostTest, TimeEndsItAndBadInputIsNamed) {
  const std::string path = Study("tracks.csv").path;
  StudyCostOptions how;
  how.within = 1e-9;
  const StudyCost cost = CostOfStudy(path, {}, how);
  EXPECT_EQ(cost.points.size(), 1U);
  EXPECT_GT(cost.left_out, 5U);
  auto message = [&](const StudyCostOptions& options) {
    try {
      CostOfStudy(path, {}, options);
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("none");
  };
  how = {};
  how.vary = {"rung"};
  EXPECT_THAT(message(how), HasSubstr("did you mean 'rungs'"));
  how = {};
  how.within = std::nan("");
  EXPECT_THAT(message(how), HasSubstr("within"));
}

}  // namespace
}  // namespace unfurl::study::study_cost_test
