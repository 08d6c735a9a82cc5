// The search within bounds.
#include "correlate/fit/solver.h"

#include <gtest/gtest.h>

#include "correlate/fit/fit.h"
#include "tests/correlate/fit_repeats.h"

namespace unfurl::correlate::solver_test {
namespace {

FitResult FitFrom(const Observations& data, const Model& model, double low, double high,
                  double start) {
  FitProblem problem;
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.trials[0].observations = &data;
  problem.parameters = TwoLinkParameters();
  problem.parameters[0].low = low;
  problem.parameters[0].high = high;
  problem.parameters[0].start = start;
  FitOptions options;
  options.profile.wanted = false;
  options.search.screened = 0;  // no other start
  return Fit(problem, options);
}

// A start on a bound from which the data pull inwards ends where any other start does; one that
// they press against the bound stays there.
TEST(Solver, ComesOffABoundAndStaysAtOne) {
  const TwoLink model;
  Rng rng(21);
  const Observations data = Record(model, TwoLink::Truth(), TwoLink::Marks(), SparseTrial(), rng);
  const FitResult inside = FitFrom(data, model, 0.8, 1.0, 0.93);
  ASSERT_TRUE(inside.Usable()) << inside.message;
  const double sigma = inside.parameters[0].sigma;
  EXPECT_NEAR(inside.parameters[0].value, TwoLink::Truth()[0], 5.0 * sigma);
  for (const double start : {0.8, 1.0}) {
    const FitResult fit = FitFrom(data, model, 0.8, 1.0, start);
    ASSERT_TRUE(fit.Usable()) << fit.message;
    // Either search ends within a twentieth of a standard error of the minimum.
    EXPECT_NEAR(fit.parameters[0].value, inside.parameters[0].value, 0.1 * sigma) << start;
  }
  EXPECT_EQ(FitFrom(data, model, 0.92, 1.0, 0.95).parameters[0].value, 0.92);
  EXPECT_EQ(FitFrom(data, model, 0.8, 0.88, 0.85).parameters[0].value, 0.88);
}

}  // namespace
}  // namespace unfurl::correlate::solver_test
