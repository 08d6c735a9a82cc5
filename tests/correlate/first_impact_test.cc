// The first impact that marks show, by which a fit's stages are laid.
#include "correlate/align/first_impact.h"

#include <gtest/gtest.h>

#include "tests/correlate/deployment.h"
#include "tests/correlate/pendulum.h"

namespace unfurl::correlate::first_impact_test {
namespace {

constexpr double kHalfWindow = 3.0;  // [samples]

double Latch(const Prediction& prediction, int count) {
  for (const ModelEvent& e : prediction.events) {
    if (e.kind == "latch" && --count == 0) return e.t;
  }
  return std::nan("");
}

// Found in `seeds` draws of noise, within half a window of six samples of the stretch from the
// model's first latch to its `last`.
void ExpectFound(const Model& model, const std::vector<double>& theta,
                 const std::vector<std::string>& marks, const Trial& trial, int last, int seeds) {
  Rng rng(1);
  const Observations once = Record(model, theta, marks, trial, rng);
  const Prediction truth = model.Evaluate(theta, once.StampsAt(trial.offset));
  const double from = Latch(truth, 1) + trial.offset, to = Latch(truth, last) + trial.offset;
  ASSERT_GT(to, 0.0);
  for (int seed = 0; seed < seeds; ++seed) {
    Observations data = once;
    for (MarkSeries& m : data.marks) {
      for (Eigen::Index i = 0; i < m.p.size(); ++i) m.p(i) += trial.sigma * rng.Normal();
      m.cov *= 2.0;
    }
    const double found = FirstImpact(data);
    EXPECT_GT(found, from - kHalfWindow * trial.step);
    EXPECT_LT(found, to + kHalfWindow * trial.step);
  }
}

TEST(FirstImpact, OfTheLatchingPendulumFound) {
  std::vector<double> theta;
  for (const Parameter& p : Pendulum::Parameters()) theta.push_back(p.start);
  const study::SceneModel model(Pendulum::Binding(), theta);
  ExpectFound(model, theta, Pendulum::Marks(), Pendulum::Recording(5e-4), 1, 20);
}

// The first latch, of the outermost arm, shows little; the second comes 25 ms later.
TEST(FirstImpact, OfTheDeploymentFound) {
  const std::vector<double> theta = {0.0055};
  const study::SceneModel model(Deployment::Binding({Deployment::kClearance}, 1e-5), theta);
  ExpectFound(model, theta, Deployment::Marks(), Deployment::Recording(1.2), 2, 10);
}

TEST(FirstImpact, NoneInSmoothMotion) {
  const TwoLink model;
  int found = 0;
  constexpr int kSeeds = 50;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    Rng rng(seed);
    const Observations data = Record(model, TwoLink::Truth(), TwoLink::Marks(), TiltedTrial(), rng);
    found += std::isfinite(FirstImpact(data)) ? 1 : 0;
  }
  EXPECT_LE(found, 1);
}

TEST(FirstImpact, NoneInARecordTooShortToTell) {
  Trial trial = TiltedTrial();
  trial.duration = 0.1;
  Rng rng(1);
  EXPECT_TRUE(
      std::isnan(FirstImpact(Record(TwoLink(), TwoLink::Truth(), TwoLink::Marks(), trial, rng))));
}

}  // namespace
}  // namespace unfurl::correlate::first_impact_test
