// Records of an oscillator in closed form, and what a fit says of laws of loss that its scene
// lacks.
#include "study/other_laws.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/random.h"
#include "base/statistics.h"
#include "data/atomic_file.h"
#include "data/study.h"
#include "study/fit_study.h"
#include "tests/dry_swing.h"
#include "tests/own_folder.h"
#include "tests/repeats.h"

namespace unfurl::study::other_laws_test {
namespace {

using ::testing::HasSubstr;

constexpr double kRate = 2.0 * std::numbers::pi * 0.7;  // undamped [rad/s]
constexpr double kInertia = 0.02;                       // [kg m^2]
constexpr double kStart = 0.6;                          // [rad]
constexpr double kDecay = 0.03;                         // [1/s]
// A quarter of what is lost, of swings of some 0.55 rad: 4 f stuck / 0.55 is 0.01 1/s.
constexpr double kStuck = 2e-3;  // [rad]

struct Nature {
  double stuck = 0.0, sigma = 2e-3, rho = 0.0;  // [rad], [rad], [-]
  bool mark = false;                            // seen by a mark a metre away; else an encoder
};

class OtherLawsTest : public ::testing::Test {
 protected:
  std::string Put(const std::string& name, const std::string& text) const {
    data::WriteTextFile((own_.path() / name).string(), text);
    return (own_.path() / name).string();
  }

  static std::string Scene(const std::string& loss) {
    return fmt::format(
        "[scene]\nname = \"wheel\"\nduration = 6.2\n[body.wheel]\nmass = 1.0\ninertia = {}\n"
        "[joint.hinge]\ninner = \"ground\"\nouter = \"wheel\"\ntheta = {}\n"
        "[joint.hinge.spring]\nstiffness = {:.17g}\n{}"
        "[mark.rim]\non = \"wheel\"\npoint = [1.0, 0.0]\n",
        kInertia, kStart, kInertia * kRate * kRate, loss);
  }
  static std::string Viscous() {
    return fmt::format("[joint.hinge.damper]\ndamping = {}\n", 2.0 * kDecay * kInertia);
  }

  // 600 readings, 10 ms apart.
  void Record(const Nature& nature, std::uint64_t seed) const {
    Rng rng(seed);
    std::string text =
        nature.mark ? "t [s],mark,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],cyy [m^2],cyz "
                      "[m^2],czz [m^2]\n"
                    : "t [s],angle [rad]\n";
    double noise[3] = {rng.Normal(), rng.Normal(), rng.Normal()};
    const double fresh = std::sqrt(1.0 - nature.rho * nature.rho);
    const double v = nature.sigma * nature.sigma;
    for (int i = 1; i <= 600; ++i) {
      for (double& x : noise) x = nature.rho * x + fresh * rng.Normal();
      const double t = 0.01 * i, angle = DrySwing(t, kRate, kStart, kDecay, nature.stuck);
      text += nature.mark ? fmt::format("{:.3f},rim,{:.9f},{:.9f},{:.9f},{},0,0,{},0,{}\n", t,
                                        std::cos(angle) + nature.sigma * noise[0],
                                        std::sin(angle) + nature.sigma * noise[1],
                                        nature.sigma * noise[2], v, v, v)
                          : fmt::format("{:.3f},{:.9f}\n", t, angle + nature.sigma * noise[0]);
    }
    Put("record.csv", text);
  }

  // Decay and frequency of the scene with viscous damping, sigma found.
  StudyFit FitOf(const Nature& nature, std::uint64_t seed) const {
    Put("scene.toml", Scene(Viscous()));
    Record(nature, seed);
    const std::string trial =
        nature.mark ? "[trial]\ntracks = \"record.csv\"\noffset = 0.0\nframe = \"known\"\n"
                    : "[trial]\noffset = 0.0\n[trial.channel.angle]\nfile = \"record.csv\"\n"
                      "quantity = \"hinge.theta\"\n";
    data::Study study = data::ReadStudy(
        Put("study.toml",
            "[study]\nscene = \"scene.toml\"\n" + trial +
                "[parameter.damping]\nkeys = [\"joint.hinge.damper.damping\"]\nstart = 2e-3\n"
                "bounds = [1e-5, 0.1]\n"
                "[parameter.stiffness]\nkeys = [\"joint.hinge.spring.stiffness\"]\nstart = 0.37\n"
                "bounds = [0.1, 1.0]\n"));
    study.profile_levels.clear();
    return Fit(study, {});
  }

  const OwnFolder own_;
};

// Found by viscous damping alone its decay was 0.040 1/s, known to a half of a per cent, and three
// of five such fits were called explained.
TEST_F(OtherLawsTest, AQuarterOfFrictionIsNoViscousDamping) {
  const int seeds = Repeats(5, 10);
  for (const bool mark : {false, true}) {
    int doubted = 0, named = 0, held = 0;
    for (int seed = 1; seed <= seeds; ++seed) {
      const StudyFit fit = FitOf({.stuck = kStuck, .mark = mark}, static_cast<std::uint64_t>(seed));
      ASSERT_TRUE(fit.Usable());
      const correlate::GoodnessOfFit& g = fit.result.trials[0].goodness;
      doubted += g.outcome == correlate::Explained::kNo ? 1 : 0;
      if (g.constancy.rival < 0) continue;
      const correlate::RivalLaw& law =
          fit.problem().trials[0].rivals[static_cast<std::size_t>(g.constancy.rival)];
      if (law.name != "dry friction in hinge") continue;
      ++named;
      const double found = law.amount * g.constancy.rival_part;
      const double sigma = law.amount * g.constancy.rival_sigma;
      const double truth = kInertia * kRate * kRate * kStuck;
      held += std::abs(found - truth) < 3.0 * sigma ? 1 : 0;
      // And what is left is the viscous part, known a tenth as well as it seemed.
      constexpr double kNear = 0.15;
      EXPECT_NEAR(fit.record.parameters[0].value + g.constancy.with_rival[0],
                  2.0 * kDecay * kInertia, kNear * 2.0 * kDecay * kInertia);
    }
    std::printf("%s: doubted %d of %d, friction named %d, its moment held %d\n",
                mark ? "mark" : "encoder", doubted, seeds, named, held);
    EXPECT_GE(10 * doubted, 8 * seeds);
    EXPECT_GE(10 * named, 8 * seeds);
    EXPECT_GE(held, named - 1);
  }
}

TEST_F(OtherLawsTest, TheReasonsSayWhatIsMissing) {
  const StudyFit fit = FitOf({.stuck = 2.0 * kStuck}, 1);
  ASSERT_EQ(fit.result.trials[0].goodness.outcome, correlate::Explained::kNo);
  std::string all;
  for (const std::string& reason : fit.record.reasons) all += reason + "\n";
  EXPECT_THAT(all, HasSubstr("With dry friction in hinge they would be explained better"));
  EXPECT_THAT(all, HasSubstr("N m, and then about damping "));
}

// How often a model that is right is doubted, whatever the noise: at most one in fifty.
TEST_F(OtherLawsTest, NoiseIsNoOtherLaw) {
  const int seeds = Repeats(6, 25);
  constexpr double kMost = 0.02, kSure = 0.998;
  std::size_t all = 0, doubted = 0;
  for (const Nature& nature :
       {Nature{}, Nature{.rho = 0.9}, Nature{.mark = true}, Nature{.rho = 0.9, .mark = true}}) {
    std::size_t own = 0;
    for (int seed = 1; seed <= seeds; ++seed) {
      const StudyFit fit = FitOf(nature, static_cast<std::uint64_t>(seed));
      own += fit.result.trials[0].goodness.outcome == correlate::Explained::kNo ? 1 : 0;
    }
    std::printf("rho %g, %s: doubted %zu of %d\n", nature.rho, nature.mark ? "mark" : "encoder",
                own, seeds);
    doubted += own;
    all += seeds;
  }
  EXPECT_LE(BinomialInterval(doubted, all, kSure).first, kMost);
}

double StoredAtSixSeconds(const SceneModel& model) {
  correlate::Stamps stamps;
  stamps.quantities.push_back({"angle", "hinge.theta", {6.0}});
  stamps.quantities.push_back({"rate", "hinge.theta_rate", {6.0}});
  const correlate::Prediction at = model.Evaluate({}, stamps);
  const double angle = at.quantities[0].values(0), rate = at.quantities[1].values(0);
  return 0.5 * kInertia * (rate * rate + kRate * kRate * angle * angle);
}

// The laws that a joint lacks beside one that it has, each of a hundredth of the energy: by what
// the run loses with it.
TEST_F(OtherLawsTest, EachTakesAHundredthOfTheEnergy) {
  SceneModelOptions plain;
  plain.scene = Put("scene.toml", Scene("[joint.hinge.damper]\ndamping = 1e-9\n"));
  plain.rtol = 1e-9;
  const SceneModel model(plain, {});
  const std::vector<OtherLaw> laws = OtherLawsOf(model.joint_records(), model, {}, 6.0);
  ASSERT_EQ(laws.size(), 2u);
  EXPECT_EQ(laws[0].name, "dry friction in hinge");
  EXPECT_EQ(laws[1].name, "damping by the square of the rate in hinge");
  const double energy = 0.5 * kInertia * kRate * kRate * kStart * kStart;
  for (const OtherLaw& law : laws) {
    SceneModelOptions other = plain;
    other.set = law.set;
    const double lost = StoredAtSixSeconds(model) - StoredAtSixSeconds(SceneModel(other, {}));
    constexpr double kNear = 0.05;  // creeping, and the swing that becomes less
    EXPECT_NEAR(lost, 0.01 * energy, kNear * 0.01 * energy) << law.name;
  }
  // None beside none.
  plain.scene = Put("free.toml", Scene(""));
  const SceneModel without(plain, {});
  EXPECT_TRUE(OtherLawsOf(without.joint_records(), without, {}, 6.0).empty());
}

}  // namespace
}  // namespace unfurl::study::other_laws_test
