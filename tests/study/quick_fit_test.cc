// A version of a study fitted on its lowest rung, against one that climbs.
#include "study/quick_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/study/arm.h"

namespace unfurl::study {
namespace {

// A clamped beam of four segments that is let go, its stiffness and damping sought from a record of
// sixteen.
class QuickFitTest : public ArmTest {
 protected:
  data::Study BeamStudy(const std::string& set = {}) const {
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
    for (int i = 0; i < 200; ++i) stamps.t[0].push_back(0.0025 * i);
    const correlate::Prediction truth = model.Evaluate({}, stamps);
    Rng rng(1);
    std::string text =
        "t [s],mark,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],cyy [m^2],cyz [m^2],czz "
        "[m^2]\n";
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3d p = truth.marks[0].p.col(i);
      text += fmt::format("{:.4f},tip,{:.8f},{:.8f},{:.8f},1e-8,0,0,1e-8,0,1e-8\n",
                          stamps.t[0][static_cast<std::size_t>(i)], p.x() + 1e-4 * rng.Normal(),
                          p.y() + 1e-4 * rng.Normal(), 1e-4 * rng.Normal());
    }
    Put("tip.csv", text);
    return data::ReadStudy(Put(
        "beam_study.toml",
        fmt::format("[study]\nscene = \"beam.toml\"\nset = [{}]\n[trial]\ntracks = \"tip.csv\"\n"
                    "offset = 0.0\nframe = \"known\"\n"
                    "[parameter.EI]\nkeys = [\"beam.a.EI\"]\nstart = 2.1\nbounds = [1.0, 4.0]\n"
                    "[profile]\nlevels = []\n",
                    set)));
  }
};

double Squares(const correlate::FitResult& fit) { return fit.trials[0].residual.squaredNorm(); }

TEST_F(QuickFitTest, OfTheStudyItselfItIsTheStudysOwnFit) {
  const data::Study study = BeamStudy();
  const StudyFit fit = Fit(study);
  ASSERT_TRUE(fit.Usable()) << fit.result.message;
  const auto quick = QuickFits(fit).Fit(study, 1);
  ASSERT_TRUE(quick && quick->result.Usable());
  // The coarse rung with the finer one's difference at the estimate is the fine one there.
  const correlate::ParameterEstimate& e = fit.result.parameters[0];
  EXPECT_NEAR(quick->result.parameters[0].value, e.value, 0.2 * e.sigma_data);
  EXPECT_NEAR(Squares(quick->result), Squares(fit.result), 0.01 * Squares(fit.result));
  ASSERT_EQ(quick->stale.size(), 1U);
  EXPECT_LT(quick->stale[0].norm(), 0.1 * std::sqrt(Squares(fit.result)));
  EXPECT_LT(quick->result.evaluations.size(), fit.result.evaluations.size());
}

TEST_F(QuickFitTest, NoFitOfTheFinestRungComesBelowItsBound) {
  const StudyFit fit = Fit(BeamStudy());
  ASSERT_TRUE(fit.Usable());
  const QuickFits quick_fits(fit);
  int telling = 0;
  // Without its damping, with five times of it, without most of its weight.
  for (const char* set : {"\"beam.a.damping=0\"", "\"beam.a.damping=5e-3\"",
                          "\"gravity.acceleration=[0.0, -8.0]\""}) {
    const data::Study version = BeamStudy(set);
    const auto quick = quick_fits.Fit(version, 1);
    ASSERT_TRUE(quick && quick->result.Usable()) << set;
    const double least = std::max(0.0, std::sqrt(Squares(quick->result)) - quick->stale[0].norm());
    data::Study finest = version;  // fitted itself
    finest.set.push_back("beam.a.segments=8");
    finest.fidelity.wanted = false;
    const StudyFit really = Fit(finest);
    ASSERT_TRUE(really.Usable()) << set;
    EXPECT_GE(1.001 * std::sqrt(Squares(really.result)), least) << set;
    telling += least > 1.2 * std::sqrt(Squares(fit.result)) ? 1 : 0;
  }
  // An undamped beam of four segments is too far from one of eight to be judged by.
  EXPECT_EQ(telling, 2);
}

TEST_F(QuickFitTest, WhatChangesTheMeshHasNone) {
  const StudyFit fit = Fit(BeamStudy());
  ASSERT_TRUE(fit.Usable());
  EXPECT_FALSE(QuickFits(fit).Fit(BeamStudy("\"beam.a.segments=1\""), 1));
  const StudyFit arm = Fit(Study("tracks.csv"));  // without a ladder
  EXPECT_FALSE(QuickFits(arm).Fit(Study("tracks.csv"), 1));
}

}  // namespace
}  // namespace unfurl::study
