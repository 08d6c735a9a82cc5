// Fits of a model that is not what made the data: other contact laws, finer meshes.
#include "tests/correlate/wrong_model.h"

#include <gtest/gtest.h>

namespace unfurl::correlate::wrong_model_test {
namespace {

TEST(WrongModel, TheSecondWritingOfTheArmIsTheSimulatorsWithItsLaw) {
  const std::vector<double> theta = {0.0055, 0.85, 3e-3, 0.22};
  const study::SceneModel model(Pendulum::Binding(1e-9), theta);
  Stamps stamps;
  stamps.marks = Pendulum::Marks();
  stamps.t.assign(2, {});
  for (double t = 0.0; t < kBouncing; t += 0.005) {
    for (auto& list : stamps.t) list.push_back(t);
  }
  const Prediction a = model.Evaluate(theta, stamps);
  auto largest = [&](StopLaw law) {
    const Prediction b = OneArm(law).Evaluate(theta, stamps);
    double most = 0.0;
    for (std::size_t m = 0; m < 2; ++m) {
      most = std::max(most, (a.marks[m].p - b.marks[m].p).colwise().norm().maxCoeff());
    }
    return most;
  };
  constexpr double kSame = 2e-6;     // a hundredth of the marks' sigma [m]
  constexpr double kAnother = 5e-4;  // [m]
  EXPECT_LT(largest(StopLaw::kScene), kSame);
  for (StopLaw law : {StopLaw::kHuntCrossley, StopLaw::kKelvinVoigt, StopLaw::kNewton}) {
    EXPECT_GT(largest(law), kAnother);
  }
}

TEST(WrongModel, AnotherContactLawIsRejectedAndTheRightOneIsNot) {
  constexpr int kSeeds = 1, kOthers = 1;  // the slow test has a hundred of each law
  const WrongModelCount right = CountWrong(FitToLaw(StopLaw::kScene, kSeeds, 11), 4);
  EXPECT_EQ(right.Outcome(Explained::kNo), 0) << right.Words(Pendulum::Parameters());
  EXPECT_EQ(right.determined, 4 * kSeeds) << right.Words(Pendulum::Parameters());
  for (StopLaw law : {StopLaw::kHuntCrossley, StopLaw::kNewton}) {
    const std::vector<WrongModelFit> fits = FitToLaw(law, kOthers, 1);
    const WrongModelCount wrong = CountWrong(fits, 4);
    // A fit that finds no minimum within its bounds has no result, and claims nothing.
    EXPECT_EQ(wrong.Outcome(Explained::kNo), wrong.usable) << wrong.Words(Pendulum::Parameters());
    EXPECT_GE(wrong.usable, 1);
    for (const WrongModelFit& one : fits) {
      for (const ParameterEstimate& e : one.fit.parameters) {
        EXPECT_NE(e.verdict, Verdict::kDetermined);
        EXPECT_NE(e.verdict, Verdict::kMeshLimited);
      }
    }
  }
}

TEST(WrongModel, AFinerMeshIsRejectedOrInTheStandardErrors) {
  constexpr int kSeeds = 1, kFiner = 16;  // the slow test has a hundred
  const std::vector<WrongModelFit> checked = FitToMesh(kFiner, true, kSeeds, 1);
  for (const WrongModelFit& one : checked) {
    for (std::size_t j = 0; j < one.truth.size(); ++j) {
      const ParameterEstimate& e = one.fit.parameters[j];
      EXPECT_LT(std::abs(e.value - one.truth[j]), 2.0 * e.sigma);
    }
    EXPECT_GT(one.fit.trials[0].goodness.mesh_takes, 0.3);
  }
  const WrongModelCount bare = CountWrong(FitToMesh(kFiner, false, kSeeds, 1), 3);
  EXPECT_EQ(bare.Outcome(Explained::kNo), kSeeds) << bare.Words(FlexibleArm::Parameters());
}

}  // namespace
}  // namespace unfurl::correlate::wrong_model_test
