// Profiles of the cost along each parameter.
#include "correlate/fit/profile.h"

#include <gtest/gtest.h>

#include "correlate/fit/fit.h"
#include "tests/correlate/fit_repeats.h"

namespace unfurl::correlate::profile_test {
namespace {

FitResult WithLevels(const Observations& data, const Model& model,
                     const std::vector<double>& levels) {
  FitProblem problem;
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.trials[0].observations = &data;
  problem.parameters = TwoLinkParameters();
  FitOptions options;
  options.profile.levels = levels;
  return Fit(problem, options);
}

// Levels below 1.96 are gone beyond, from the outermost on, in whatever order they are given.
TEST(Profile, OrderOfLevelsDoesNotMatter) {
  const TwoLink model;
  Rng rng(22);
  const Observations data = Record(model, TwoLink::Truth(), TwoLink::Marks(), SparseTrial(), rng);
  const FitResult up = WithLevels(data, model, {0.4, 1.0}),
                  down = WithLevels(data, model, {1.0, 0.4});
  ASSERT_TRUE(up.Usable()) << up.message;
  for (std::size_t j = 0; j < 2; ++j) {
    const Profile &a = up.parameters[j].profile, &b = down.parameters[j].profile;
    EXPECT_LT(a.low, up.parameters[j].value);
    EXPECT_GT(a.high, up.parameters[j].value);
    ASSERT_EQ(a.points.size(), b.points.size());
    for (std::size_t i = 0; i < a.points.size(); ++i) {
      EXPECT_EQ(a.points[i].value, b.points[i].value);
      EXPECT_EQ(a.points[i].deviance, b.points[i].deviance);
    }
    EXPECT_EQ(a.low, b.low);
    EXPECT_EQ(a.high, b.high);
  }
}

}  // namespace
}  // namespace unfurl::correlate::profile_test
