// Estimates at a kink of the model: its differences to either side disagree.
#include <gtest/gtest.h>

#include <algorithm>

#include "correlate/fit/fit.h"
#include "tests/correlate/fit_repeats.h"
#include "tests/correlate/two_link.h"

namespace unfurl::correlate::kink_test {
namespace {

// An arm that no value makes slower than the truth: below it goes faster again, a tenth as fast.
class Kinked : public TwoLink {
 public:
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    const double by = theta[0] - Truth()[0];
    return TwoLink::Evaluate(std::vector<double>{Truth()[0] + std::max(by, -0.1 * by), theta[1]},
                             stamps);
  }
};

// What is solved with is one side's slope; what is said of the noise is said of the same slope, or
// a noise that is a little stronger takes more information away than there is.
TEST(Kink, StandardErrorsAreNumbersWhereTheNoiseHasAMemory) {
  constexpr int kSeeds = 4;
  int kinks = 0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    Trial trial = SparseTrial();
    trial.rho = 0.9;
    Rng rng(seed + 500);
    const Kinked model;
    // Slower than the truth, so that the truth is the best that there is.
    const std::vector<double> slower = {TwoLink::Truth()[0] - 5e-5, TwoLink::Truth()[1]};
    const Observations data = Record(TwoLink(), slower, TwoLink::Marks(), trial, rng);
    FitProblem problem;
    problem.trials.resize(1);
    problem.trials[0].model = &model;
    problem.parameters = TwoLinkParameters();
    problem.trials[0].observations = &data;
    const FitResult fit = Fit(problem);
    ASSERT_TRUE(fit.Usable()) << fit.message;
    ASSERT_TRUE(fit.covariance.allFinite()) << "seed " << seed;
    for (const ParameterEstimate& e : fit.parameters) {
      // White noise of the samples' own sigma is the least that there is.
      EXPECT_GT(e.sigma_data, e.sigma_white) << "seed " << seed;
      EXPECT_LT(e.sigma_data, 20.0 * e.sigma_white) << "seed " << seed;
    }
    kinks += fit.parameters[0].kink > 0.3 ? 1 : 0;
  }
  EXPECT_GT(kinks, kSeeds / 2);
}

}  // namespace
}  // namespace unfurl::correlate::kink_test
