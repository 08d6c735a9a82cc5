// Versions of a fitted study, refitted from where it came out, against fits of their own.
#include "correlate/fit/refit.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "study/effect_versions.h"
#include "tests/study/arm.h"
#include "tests/study/swing.h"

namespace unfurl::study::refit_test {
namespace {

class RefitTest : public ArmTest {
 protected:
  static double Squares(const correlate::FitResult& fit) {
    return fit.trials[0].residual.squaredNorm();
  }
  static double Squares(const correlate::Refitted& r) { return r.residual[0].squaredNorm(); }
  static correlate::Refitted Of(const StudyFit& fit, const EffectVersion& version,
                                correlate::RefitOptions how = {}) {
    const correlate::Refits refits(fit.problem(), fit.result, fit.binding->options);
    how.look_first = version.look_first;
    how.workers = 1;
    return refits.Refit(version.binding.problem, how);
  }
};

TEST_F(RefitTest, OfTheStudyItselfItStays) {
  const data::Study study = BeamStudy();
  const StudyFit fit = Fit(study);
  ASSERT_TRUE(fit.Usable()) << fit.result.message;
  const EffectVersions versions(study, fit);
  const correlate::Refitted same = Of(fit, versions.AsItIs());
  ASSERT_EQ(same.status, correlate::RefitStatus::kSettled) << same.message;
  const correlate::ParameterEstimate& e = fit.result.parameters[0];
  EXPECT_NEAR(same.theta[0], e.value, 0.2 * e.sigma);
  EXPECT_LT(Squares(same), 1.001 * Squares(fit.result));
  EXPECT_LT(same.runs + same.looks, fit.result.evaluations.size() / 2);
}

// What a version comes to is what a fit of the finest rung comes to, and that does not come below
// what the refit says is left.
TEST_F(RefitTest, AVersionComesWhereItsOwnFitComes) {
  const data::Study study = BeamStudy();
  const StudyFit fit = Fit(study);
  ASSERT_TRUE(fit.Usable());
  const EffectVersions versions(study, fit);
  for (const char* set :
       {"beam.a.damping=0", "beam.a.damping=5e-3", "gravity.acceleration=[0.0, -8.0]"}) {
    const correlate::Refitted found = Of(fit, versions.Switched({set}, true));
    ASSERT_TRUE(found.status == correlate::RefitStatus::kSettled ||
                found.status == correlate::RefitStatus::kBudget)
        << set << ": " << found.message;
    data::Study finest = study;  // fitted itself
    finest.set = {set, "beam.a.segments=8"};
    finest.fidelity.wanted = false;
    const StudyFit really = Fit(finest);
    ASSERT_TRUE(really.Usable()) << set;
    EXPECT_GE(1.001 * Squares(really.result), found.least * Squares(found)) << set;
    if (found.status != correlate::RefitStatus::kSettled) continue;
    const correlate::ParameterEstimate& e = really.result.parameters[0];
    const double scale = std::sqrt(std::max(1.0, Squares(really.result) / found.rows));
    EXPECT_NEAR(found.theta[0], e.value, 0.5 * scale * e.sigma_data) << set;
    EXPECT_NEAR(Squares(found), Squares(really.result), 0.02 * Squares(really.result)) << set;
  }
}

// A finer mesh than the finest rung is looked at itself, and led to by the lowest.
TEST_F(RefitTest, AFinerMeshIsFinerThanTheFinestRung) {
  const data::Study study = BeamStudy();
  const StudyFit fit = Fit(study);
  ASSERT_TRUE(fit.Usable());
  const EffectVersions versions(study, fit);
  bool seen = false;
  for (const EffectSwitch& effect : versions.Effects(false)) {
    if (effect.name != "a finer mesh") continue;
    seen = true;
    ASSERT_EQ(effect.set.size(), 1U);
    EXPECT_EQ(effect.set[0], "beam.a.segments=16");
    const EffectVersion version = versions.Switched(effect.set, effect.there);
    EXPECT_TRUE(version.look_first);
    const correlate::Refitted found = Of(fit, version);
    ASSERT_EQ(found.status, correlate::RefitStatus::kSettled) << found.message;
    // The record was made on sixteen segments.
    EXPECT_NEAR(found.theta[0], 2.0, 4.0 * fit.result.parameters[0].sigma_data);
  }
  EXPECT_TRUE(seen);
}

TEST_F(RefitTest, ABudgetIsKept) {
  const data::Study study = BeamStudy();
  const StudyFit fit = Fit(study);
  ASSERT_TRUE(fit.Usable());
  const EffectVersions versions(study, fit);
  correlate::RefitOptions how;
  how.runs = 2;
  const correlate::Refitted found =
      Of(fit, versions.Switched({"gravity.acceleration=[0.0, -5.0]"}, true), how);
  EXPECT_EQ(found.status, correlate::RefitStatus::kBudget);
  EXPECT_LE(found.runs, 6U);  // clocks, and an alignment, come on top
  EXPECT_LT(found.least, 1.0);
  how.runs = 0;
  EXPECT_THROW(Of(fit, versions.AsItIs(), how), Error);
}

// No parameter is left: the motion is what it is.
TEST_F(RefitTest, WithoutParametersTheModelIsHeldAgainstTheRecord) {
  const data::Study study = BeamStudy();
  const StudyFit fit = Fit(study);
  ASSERT_TRUE(fit.Usable());
  const double value = fit.record.parameters[0].value;
  const EffectVersions versions(study, fit);
  const correlate::Refitted as_is = Of(fit, versions.AsItIs(), {});
  const correlate::Refitted same =
      Of(fit, versions.Switched({fmt::format("beam.a.EI={:.17g}", value)}, true), {});
  const correlate::Refitted off =
      Of(fit, versions.Switched({fmt::format("beam.a.EI={:.17g}", 1.2 * value)}, true), {});
  for (const correlate::Refitted* found : {&same, &off}) {
    EXPECT_EQ(found->status, correlate::RefitStatus::kSettled) << found->message;
    EXPECT_TRUE(found->theta.empty());
  }
  EXPECT_NEAR(same.whitened[0].squaredNorm(), as_is.whitened[0].squaredNorm(), 1.0);
  EXPECT_GT(off.whitened[0].squaredNorm(), 10.0 * as_is.whitened[0].squaredNorm());
}

TEST_F(RefitTest, BadInputIsNamed) {
  const data::Study study = BeamStudy();
  const StudyFit fit = Fit(study);
  ASSERT_TRUE(fit.Usable());
  const EffectVersions versions(study, fit);
  EXPECT_THROW(versions.Switched({"beam.a.dampng=0"}, true), Error);
  const correlate::Refits refits(fit.problem(), fit.result, fit.binding->options);
  correlate::FitProblem other = fit.problem();
  other.parameters[0].name = "another";
  EXPECT_THROW(refits.Refit(other, {}), Error);
  other.trials.clear();
  EXPECT_THROW(refits.Refit(other, {}), Error);
}

// A pendulum, recorded with quadratic damping alone and refitted without, which the linear damping
// of the scene has to take over; beside a fit of the study that has only that.
class TakeOverTest : public SwingTest {
 protected:
  static constexpr double kSigma = 1e-3;  // [rad]

  // `law`: bounds of the linear damping. `placed`: the offset is known.
  data::Study LawsStudy(const std::string& law, bool quadratic, bool placed) const {
    const std::string name = quadratic ? "both" : "one";
    std::string joint = "[joint.hinge.damper]\ndamping = 0.01\n";
    std::string parameters =
        "[parameter.c]\nkeys = [\"joint.hinge.damper.damping\"]\nstart = 0.01\n" + law;
    if (quadratic) {
      joint += "[joint.hinge.quadratic_damper]\ndamping = 0.01\n";
      parameters +=
          "[parameter.d]\nkeys = [\"joint.hinge.quadratic_damper.damping\"]\nstart = 0.01\n"
          "bounds = [1e-9, 0.2]\n";
    }
    Put(name + ".toml", Scene(joint));
    data::Study out = StudyOf(name, name + ".toml", kSigma, parameters);
    if (!placed) out.trials[0].offset = {};
    out.profile_levels.clear();
    return out;
  }

  void TakesOver(const std::string& law, double quadratic, bool placed) const {
    Record({.quadratic = quadratic}, kSigma, 7);  // such noise that no linear damping is found
    const data::Study study = LawsStudy(law, true, placed);
    const StudyFit fit = Fit(study);
    ASSERT_TRUE(fit.Usable()) << fit.result.message;
    const EffectVersions versions(study, fit);
    const correlate::Refits refits(fit.problem(), fit.result, fit.binding->options);
    const EffectVersion version = versions.Switched({"joint.hinge.quadratic_damper="}, true);
    const correlate::Refitted found = refits.Refit(version.binding.problem, {.workers = 1});
    const StudyFit alone = Fit(LawsStudy(law, false, placed));
    ASSERT_TRUE(alone.Usable()) << alone.result.message;
    ASSERT_EQ(found.residual.size(), 1U) << found.message;
    const double least = alone.result.trials[0].residual.squaredNorm();
    EXPECT_NEAR(found.residual[0].squaredNorm(), least, 0.02 * least);
    EXPECT_NEAR(found.theta[0], alone.result.parameters[0].value,
                0.5 * alone.result.parameters[0].sigma_data);
  }
};

// The fit leaves it at next to nothing, where a logarithm has no slope.
TEST_F(TakeOverTest, ALogarithmThatIsNextToNothing) {
  TakesOver("bounds = [1e-9, 0.2]\ntransform = \"log\"\n", 0.004, true);
}

// Without the damping another swing lies nearer to the record than its own.
TEST_F(TakeOverTest, OnTheSameSwing) { TakesOver("bounds = [1e-9, 0.2]\n", 0.05, false); }

}  // namespace
}  // namespace unfurl::study::refit_test
