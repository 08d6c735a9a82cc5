// Standard errors that were planned against the scatter of what was then found.
#include <gtest/gtest.h>

#include <cmath>

#include "base/worker_pool.h"
#include "tests/correlate/planned.h"

namespace unfurl::correlate::design_slow_test {
namespace {

// 200 virtual trials with another cycle and a mark that the trial at hand did not have. The scatter
// of 200 is known to 5%; asked is 0.9 to 1.1.
TEST(DesignSlow, PlannedErrorsAreTheScatterOfVirtualTrials) {
  constexpr int kTrials = 200;
  Trial trial = TiltedTrial();
  trial.sigma = 1e-3;
  const Fitted at_hand(trial, 11, {"base", "elbow", "tip"});
  const PlanBasis basis{&at_hand.problem, &at_hand.fit, &at_hand.options, 0};
  const PlannedContent content =
      ContentOf({"base", "base2", "elbow", "tip"}, trial, trial.step / 4.0, 4);
  const PlannedTrial plan(basis, at_hand.model, content);
  const Choice choices[] = {{{{}, {0}, {}, {1, 2, 3}}, {}}, {{{0}, {1}, {2, 3}, {}}, {}}};
  for (const Choice& choice : choices) {
    const Eigen::VectorXd planned = PlannedErrors(basis, plan, choice, false);
    std::vector<FitResult> fits(kTrials);
    ParallelFor(fits.size(), 0, [&](std::size_t i) {
      Rng rng(1000 + i);
      fits[i] = FitTwoLink(at_hand.model, Recorded(content, choice, trial, rng), false);
    });
    for (std::size_t j = 0; j < 2; ++j) {
      double sum = 0.0, squares = 0.0;
      for (const FitResult& fit : fits) {
        ASSERT_TRUE(fit.Usable()) << fit.message;
        sum += fit.parameters[j].value;
        squares += fit.parameters[j].value * fit.parameters[j].value;
      }
      const double mean = sum / kTrials;
      const double scatter = std::sqrt((squares - kTrials * mean * mean) / (kTrials - 1));
      const double ratio = planned(static_cast<Eigen::Index>(j)) / scatter;
      fmt::print("parameter {}: planned over achieved {:.3f}\n", j, ratio);
      EXPECT_GT(ratio, 0.9);
      EXPECT_LT(ratio, 1.1);
    }
  }
}

}  // namespace
}  // namespace unfurl::correlate::design_slow_test
