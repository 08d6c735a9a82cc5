// The search within bounds.
#include "correlate/fit/solver.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "correlate/fit/fit.h"
#include "correlate/residual/channel.h"
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

// A motion that is the sum of two that hardly differ, as viscous damping and dry friction make
// them: each parameter is the size of one.
class NearlyTheSame : public Model {
 public:
  static std::vector<double> Truth() { return {0.02, 0.03}; }

  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Prediction out;
    for (const QuantityStamps& q : stamps.quantities) {
      Eigen::VectorXd values(static_cast<Eigen::Index>(q.t.size()));
      for (Eigen::Index i = 0; i < values.size(); ++i) {
        const double t = q.t[static_cast<std::size_t>(i)], s = std::sin(3.0 * t);
        values(i) = theta[0] * s + theta[1] * (s + 0.05 * std::sin(9.0 * t));
      }
      out.quantities.push_back({q.key, std::move(values)});
    }
    return out;
  }
};

// A fit of its record by a clock that is known, from `first`, which is the bound, and the size of
// the second that imitates what is missing.
FitResult FitNearlyTheSame(double first) {
  const NearlyTheSame model;
  Rng rng(5);
  ChannelRecord r;
  r.name = r.quantity = "sum";
  constexpr double kSigma = 1e-6;  // so that misfit rules over noise by far
  std::vector<double> values;
  for (double t = 0.05; t < 5.0; t += 0.01) {
    r.t.push_back(t);
    const double s = std::sin(3.0 * t);
    values.push_back(0.02 * s + 0.03 * (s + 0.05 * std::sin(9.0 * t)) + kSigma * rng.Normal());
  }
  r.y = Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values));
  r.sigma = Eigen::VectorXd::Constant(r.y.size(), kSigma);
  Observations data;
  data.placement.offset = data.placement.drift = Prior::Known(0.0);
  data.others = {std::make_shared<Channel>(std::move(r))};
  FitProblem problem;
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.trials[0].observations = &data;
  problem.parameters.resize(2);
  for (Parameter& p : problem.parameters) {
    p.low = first, p.high = 1.0, p.log = true;
  }
  problem.parameters[0].name = "first", problem.parameters[0].start = first;
  problem.parameters[1].name = "second", problem.parameters[1].start = 0.05;
  FitOptions options;
  options.profile.wanted = false;
  options.search.screened = 0;  // no other start
  return Fit(problem, options);
}

// The slope of a logarithm that is far too small asks for a step of twenty, or of ten thousand: as
// many times the value, and not its exponential. So the way from far off takes no more runs.
TEST(Solver, ALogarithmFarTooSmallIsNotOvershot) {
  std::vector<std::size_t> runs;
  for (const double first : {1e-3, 2e-6}) {
    const FitResult fit = FitNearlyTheSame(first);
    ASSERT_EQ(fit.status, FitStatus::kConverged) << first << ": " << fit.message;
    for (std::size_t j = 0; j < 2; ++j) {
      const ParameterEstimate& e = fit.parameters[j];
      EXPECT_NEAR(e.value, NearlyTheSame::Truth()[j], 5.0 * e.sigma) << first << " " << j;
      EXPECT_LT(e.sigma, 0.01 * e.value) << first << " " << j;
    }
    runs.push_back(fit.evaluations.size());
  }
  EXPECT_LE(runs[1], runs[0]);
}

}  // namespace
}  // namespace unfurl::correlate::solver_test
