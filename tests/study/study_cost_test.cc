// What the width of a study's intervals costs.
#include "study/study_cost.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "tests/study/arm.h"

namespace unfurl::study {
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

TEST_F(StudyCostTest, RungsOfABeamAndTheirTest) {
  // A clamped beam that is let go; its stiffness.
  Put("beam.toml",
      "[scene]\nname = \"beam\"\nduration = 0.5\n[gravity]\nacceleration = [0.0, -9.81]\n"
      "[beam.a]\nlength = 1.0\nmass = 0.5\nEI = 2.0\nsegments = 4\ndamping = 1e-3\n"
      "[weld.clamp]\ninner = \"ground\"\nouter = \"a.start\"\n[mark.tip]\non = \"a.end\"\n");
  SceneModelOptions options;
  options.scene = (folder_ / "beam.toml").string();
  options.set = {"beam.a.segments=16"};
  options.rtol = 1e-8;
  const SceneModel model(options, {});
  correlate::Stamps stamps;
  stamps.marks = {"tip"};
  stamps.t.resize(1);
  for (int i = 0; i < 100; ++i) stamps.t[0].push_back(0.005 * i);
  const correlate::Prediction truth = model.Evaluate({}, stamps);
  ASSERT_EQ(truth.status, correlate::ModelStatus::kGood) << truth.message;
  Rng rng(1);
  std::string text =
      "t [s],mark,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],cyy [m^2],cyz [m^2],czz [m^2]\n";
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d p = truth.marks[0].p.col(i);
    text += fmt::format("{:.3f},tip,{:.8f},{:.8f},{:.8f},1e-8,0,0,1e-8,0,1e-8\n",
                        stamps.t[0][static_cast<std::size_t>(i)], p.x() + 1e-4 * rng.Normal(),
                        p.y() + 1e-4 * rng.Normal(), 1e-4 * rng.Normal());
  }
  Put("tip.csv", text);
  const std::string path =
      Put("beam_study.toml",
          "[study]\nscene = \"beam.toml\"\n[trial]\ntracks = \"tip.csv\"\noffset = 0.0\n"
          "frame = \"known\"\n[parameter.EI]\nkeys = [\"beam.a.EI\"]\nstart = 2.1\n"
          "bounds = [1.0, 4.0]\n");
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
}  // namespace unfurl::study
