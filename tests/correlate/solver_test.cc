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

// A way that ends where its slopes foretell the steps hands them on: the solution that goes on from
// there finds the minimum that a way to its end and a solution after it find, and no dearer.
TEST(Solver, WhatLeadsHandsItsSlopesOn) {
  const TwoLink model;
  Rng rng(22);
  const Observations data = Record(model, TwoLink::Truth(), TwoLink::Marks(), SparseTrial(), rng);
  FitProblem problem;
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.trials[0].observations = &data;
  problem.parameters = TwoLinkParameters();
  const auto workers = LocalWorkers(1);
  struct Found {
    std::vector<double> u;
    Eigen::VectorXd sigma;
    std::size_t runs = 0;
  };
  auto solve = [&](bool leads) {
    Evaluator evaluator(problem, *workers);
    const Registration start = Align(data, SampledModel(model, TwoLink::Truth(), TwoLink::Marks(),
                                                        0.0, 2.0 * data.End(), 1e-3))
                                   .at;
    evaluator.SetStamps({data.StampsAt(start.clock())}, 0);
    ReducedProblem reduced({{0, &data, start.clock(), start, nullptr}}, {}, evaluator);
    Slopes slopes;
    SolverOptions how;
    how.slopes = &slopes;
    how.difference_target = 0.1;
    how.step_tolerance = 0.5;
    how.verify = false;
    how.leads = leads;
    std::vector<double> u;
    for (const Parameter& p : problem.parameters) u.push_back(ToInternal(p, p.start));
    const SolverResult way = Solve(reduced, problem.parameters, u, how);
    EXPECT_EQ(way.status, SolverStatus::kConverged) << way.message;
    EXPECT_TRUE(slopes.known() || !leads);
    how.step_tolerance = 0.02;
    how.verify = true;
    how.leads = false;
    how.central_from_start = true;
    const SolverResult end = Solve(reduced, problem.parameters, way.u, how);
    EXPECT_EQ(end.status, SolverStatus::kConverged) << end.message;
    EXPECT_TRUE(slopes.fresh());
    return Found{end.u, end.sigma, evaluator.records().size()};
  };
  const Found apart = solve(false), on = solve(true);
  for (std::size_t j = 0; j < apart.u.size(); ++j) {
    // Each ends within a fiftieth of a standard error of the minimum.
    EXPECT_NEAR(on.u[j], apart.u[j], 0.04 * apart.sigma(static_cast<Eigen::Index>(j))) << j;
  }
  EXPECT_LE(on.runs, apart.runs);
}

}  // namespace
}  // namespace unfurl::correlate::solver_test
