// Fits of a model that is not what made the data, a hundred of each: what is rejected, and how far
// off the values are.
#include <gtest/gtest.h>

#include "tests/correlate/wrong_model.h"

namespace unfurl::correlate::wrong_model_slow_test {
namespace {

constexpr int kSeeds = 100;
constexpr double kUsable = 0.97;  // at least; the rest do not converge and say so
constexpr double kFine = 5e-4;    // marks that show another law or mesh in every trial [m]

TEST(WrongModelSlow, ContactLaws) {
  const char* const names[] = {"the scene's own", "Hunt and Crossley", "Kelvin and Voigt",
                               "Newton, rigid"};
  for (double sigma : {2e-4, 1e-3}) {
    for (StopLaw law :
         {StopLaw::kScene, StopLaw::kHuntCrossley, StopLaw::kKelvinVoigt, StopLaw::kNewton}) {
      const WrongModelCount count = CountWrong(FitToLaw(law, kSeeds, 1, sigma), 4);
      fmt::print("marks' sigma {:g} m, {}: {}\n", sigma, names[static_cast<int>(law)],
                 count.Words(Pendulum::Parameters()));
      std::fflush(stdout);
      if (law == StopLaw::kScene) {
        EXPECT_GE(count.usable, kUsable * kSeeds);
        const auto [low, high] =
            BinomialInterval(static_cast<std::size_t>(count.Outcome(Explained::kNo)), kSeeds, 0.99);
        EXPECT_LE(low, kGoodnessLevel);
        for (std::size_t j = 0; j < 4; ++j) {
          // Three standard errors of the mean.
          EXPECT_LT(std::abs(count.bias_sigmas[j]), 3.0 * count.scatter[j] / std::sqrt(kSeeds));
        }
      } else {
        // A fit that gives no result says nothing wrong. At 1 mm the parameters make up for most of
        // Kelvin and Voigt's law, and no test of residuals can tell: the figures are printed.
        if (sigma < kFine) {
          EXPECT_EQ(count.Outcome(Explained::kNo), count.usable);
          EXPECT_EQ(count.determined, 0);
        }
      }
    }
  }
}

TEST(WrongModelSlow, FinerMesh) {
  struct Case {
    int segments;
    bool checked;
  };
  for (double sigma : {2e-4, 1e-3}) {
    for (const Case& c : {Case{4, true}, Case{16, true}, Case{16, false}}) {
      const WrongModelCount count =
          CountWrong(FitToMesh(c.segments, c.checked, kSeeds, 1, sigma), 3);
      fmt::print("marks' sigma {:g} m, made with {} segments, {} check of the mesh: {}\n", sigma,
                 c.segments, c.checked ? "with" : "without",
                 count.Words(FlexibleArm::Parameters()));
      std::fflush(stdout);
      EXPECT_GE(count.usable, kUsable * kSeeds);
      if (c.checked) {
        EXPECT_EQ(count.determined_wrongly, 0);
      } else if (sigma < kFine) {
        EXPECT_EQ(count.Outcome(Explained::kNo), kSeeds);
      }
    }
  }
}

// How often what is printed as 95% holds the truth, parameter by parameter, where the data come
// from another mesh or another model of beams than the fit's; beside it the interval of the data
// alone. One noise level and generator a shard: --gtest_filter='*IntervalsOfAllParts*/4'.
// With the ladder of 4, 6 and 8 segments: shards 9 to 17.
class IntervalsOfAllParts : public ::testing::TestWithParam<int> {};

TEST_P(IntervalsOfAllParts, HoldTheTruth) {
  const bool ladder = GetParam() >= 9;
  const int kEach = ladder ? 20 : 40;
  constexpr double kSigmas[] = {1e-4, 3e-4, 1e-3};  // of the marks [m]
  const BeamNature generators[] = {{16, 0, true, true}, {32, 0, true, true}, {0, 4, true, true}};
  const double sigma = kSigmas[GetParam() % 9 / 3];
  BeamNature beam = generators[GetParam() % 3];
  beam.ladder = ladder;
  const std::vector<WrongModelFit> fits = FitToBeam(beam, kEach, 1, sigma);
  const std::vector<Parameter> parameters = FlexibleArm::Parameters();
  int usable = 0, one_sided = 0, unexplained = 0;
  for (const WrongModelFit& one : fits) {
    usable += one.fit.Usable() ? 1 : 0;
    one_sided += one.fit.ladder.one_sided ? 1 : 0;
    unexplained += one.fit.Usable() && one.fit.trials[0].goodness.outcome == Explained::kNo ? 1 : 0;
  }
  fmt::print("told that the model does not explain the data: {} of {}\n", unexplained, usable);
  EXPECT_LE(BinomialInterval(static_cast<std::size_t>(unexplained),
                             static_cast<std::size_t>(usable), 0.99)
                .first,
            0.02);
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    int all = 0, data = 0, open = 0;
    double width = 0.0;  // half, of the value
    for (const WrongModelFit& one : fits) {
      if (!one.fit.Usable()) continue;
      const ParameterEstimate& e = one.fit.parameters[j];
      auto holds = [&](const Interval& in) {
        return !(one.truth[j] < in.low) && !(one.truth[j] > in.high);  // an open side holds
      };
      all += holds(e.all95) ? 1 : 0;
      data += holds(e.data95) ? 1 : 0;
      open += e.all95.Closed() ? 0 : 1;
      if (e.all95.Closed()) width += 0.5 * (e.all95.high - e.all95.low) / e.value;
    }
    const auto [low, high] =
        BinomialInterval(static_cast<std::size_t>(all), static_cast<std::size_t>(usable));
    fmt::print(
        "marks' sigma {:g} m, made with {}{}: {} of all parts holds {} of {} ({:.2f} to {:.2f}), "
        "half as wide as {:.2f}% of the value; of the data alone {}; open {}; one-sided {}\n",
        sigma, beam.Set().back(), ladder ? ", on the ladder" : "", parameters[j].name, all, usable,
        low, high, 100.0 * width / std::max(1, usable - open), data, open, one_sided);
    std::fflush(stdout);
    // Never less than 95%, as far as so many trials can tell. It may be more: the mesh's part is a
    // bound (docs/decisions/055).
    EXPECT_GE(high, 0.95) << parameters[j].name;
  }
  EXPECT_GE(usable, kUsable * kEach);
}
INSTANTIATE_TEST_SUITE_P(Study, IntervalsOfAllParts, ::testing::Range(0, 18));

// Effects that the fit's scene lacks, on the ladder, where the mesh's known error is larger than
// the marks' sigma or of its size. What is wrong must be said: by the verdict of the whole, or by
// an interval that holds the truth. One fault and noise level a shard.
struct Fault {
  const char* name;
  std::vector<std::string> set;
};

class FaultsOnTheLadder : public ::testing::TestWithParam<int> {};

TEST_P(FaultsOnTheLadder, AreNamedOrHeld) {
  const Fault faults[] = {
      {"friction of 14 mN m",
       {"joint.hinge.friction.moment=0.014", "joint.hinge.friction.creep_rate=0.1"}},
      {"a mass larger by a fifth", {"beam.arm.mass=0.509"}},
      {"gravity of 0.1 m/s^2", {"gravity.acceleration=[0.0, -0.1]"}},
      {"bending stiffness less by a fifth", {"beam.arm.E=5.5e10"}},
      {"a preload less by a tenth", {"joint.hinge.spring.preload=1.41"}},
      {"none", {}}};
  constexpr double kSigmas[] = {1e-4, 3e-4, 1e-3};
  constexpr int kEach = 10;
  const Fault& fault = faults[GetParam() / 3];
  const double sigma = kSigmas[GetParam() % 3];
  BeamNature beam{16, 0, true, false, true, fault.set};
  int usable = 0, named = 0, within_known = 0, silently = 0;
  for (const WrongModelFit& one : FitToBeam(beam, kEach, 1, sigma)) {
    if (!one.fit.Usable()) continue;
    ++usable;
    const GoodnessOfFit& g = one.fit.trials[0].goodness;
    named += g.outcome == Explained::kNo || g.outcome == Explained::kNoise ? 1 : 0;
    within_known += g.within_known ? 1 : 0;
    bool wrong = false;
    for (std::size_t j = 0; j < 2; ++j) {  // the stiffness of the spring takes the pace's part
      const Interval& in = one.fit.parameters[j].all95;
      wrong = wrong || one.truth[j] < in.low || one.truth[j] > in.high;
    }
    silently += wrong && g.outcome != Explained::kNo && g.outcome != Explained::kNoise ? 1 : 0;
  }
  fmt::print(
      "fault: {}; marks' sigma {:g} m: {} of {} usable, {} named, {} within the known error; wrong "
      "without a word {}\n",
      fault.name, sigma, usable, kEach, named, within_known, silently);
  std::fflush(stdout);
  // By chance one value in twenty lies outside.
  EXPECT_LE(BinomialInterval(static_cast<std::size_t>(silently),
                             static_cast<std::size_t>(std::max(1, usable)), 0.99)
                .first,
            0.1);
}
INSTANTIATE_TEST_SUITE_P(Study, FaultsOnTheLadder, ::testing::Range(0, 18));

}  // namespace
}  // namespace unfurl::correlate::wrong_model_slow_test
