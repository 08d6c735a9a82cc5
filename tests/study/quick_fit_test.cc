// A version of a study fitted on its lowest rung, against one that climbs.
#include "study/quick_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/study/arm.h"

namespace unfurl::study {
namespace {

class QuickFitTest : public ArmTest {};

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
