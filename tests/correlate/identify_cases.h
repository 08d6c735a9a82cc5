#pragma once

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "correlate/fit/fit.h"
#include "tests/correlate/fit_repeats.h"
#include "tests/correlate/two_link.h"

namespace unfurl::correlate {

// Models in which sets of parameters act only together, each with what must be said of it.
struct IdentifyCase {
  std::string name;
  std::vector<Parameter> parameters;
  std::vector<double> truth;
  // By parameter: the partners that must be named; empty: it must not be called a combination.
  std::vector<std::vector<std::string>> with;
  std::function<std::vector<double>(std::span<const double>)>
      to_two_link;  // frequency, decay, delay
};

class Mapped : public TwoLink {
 public:
  explicit Mapped(const IdentifyCase& which) : case_(which) {}
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    const std::vector<double> three = case_.to_two_link(theta);
    Stamps late = stamps;
    for (auto& list : late.t) {
      for (double& t : list) t -= three[2];
    }
    return TwoLink::Evaluate(std::span(three).first(2), late);
  }

 private:
  const IdentifyCase& case_;
};

inline Parameter Named(const std::string& name, double start, double low, double high,
                       bool log = false) {
  Parameter p;
  p.name = name;
  p.start = start;
  p.low = low;
  p.high = high;
  p.log = log;
  return p;
}

inline std::vector<IdentifyCase> IdentifyCases() {
  std::vector<IdentifyCase> all;
  all.push_back({"a product of two",
                 {Named("stiffness", 0.65, 0.1, 2.0), Named("scale", 1.5, 0.1, 2.0),
                  Named("decay", 0.5, 0.01, 5.0, true)},
                 {0.6, 1.5, 0.35},
                 {{"scale"}, {"stiffness"}, {}},
                 [](std::span<const double> x) {
                   return std::vector<double>{x[0] * x[1], x[2], 0.0};
                 }});
  all.push_back({"a product of three, as logarithms",
                 {Named("a", 0.8, 0.1, 10.0, true), Named("b", 1.0, 0.1, 10.0, true),
                  Named("c", 1.1, 0.1, 10.0, true), Named("decay", 0.5, 0.01, 5.0, true)},
                 {0.75, 1.0, 1.2, 0.35},
                 {{"b", "c"}, {"a", "c"}, {"a", "b"}, {}},
                 [](std::span<const double> x) {
                   return std::vector<double>{x[0] * x[1] * x[2], x[3], 0.0};
                 }});
  all.push_back({"two pairs",
                 {Named("a", 0.5, 0.1, 1.0), Named("b", 0.45, 0.1, 1.0),
                  Named("c", 0.2, 0.01, 1.0, true), Named("d", 2.0, 0.1, 10.0, true)},
                 {0.45, 0.45, 0.175, 2.0},
                 {{"b"}, {"a"}, {"d"}, {"c"}},
                 [](std::span<const double> x) {
                   return std::vector<double>{x[0] + x[1], x[2] * x[3], 0.0};
                 }});
  all.push_back({"a delay, which the time offset imitates",
                 {Named("frequency", 0.95, 0.5, 2.0), Named("decay", 0.5, 0.01, 5.0, true),
                  Named("delay", 0.01, -0.05, 0.05)},
                 {0.9, 0.35, 0.0},
                 {{}, {}, {"time offset"}},
                 [](std::span<const double> x) {
                   return std::vector<double>{x[0], x[1], x[2]};
                 }});
  // Nothing hidden: strongly correlated, and yet each is known. No partner may be named.
  all.push_back(
      {"two that are strongly correlated",
       {Named("sum", 0.95, 0.5, 2.0), Named("tilt", 0.1, 0.01, 1.0)},
       {0.9, 0.35},
       {{}, {}},
       [](std::span<const double> x) {
         return std::vector<double>{x[0] + 0.3 * (x[1] - 0.35), x[1] + 0.05 * (x[0] - 0.9), 0.0};
       }});
  return all;
}

struct IdentifyCount {
  int named = 0, should = 0;        // parameters that are hidden, with just their partners named
  int false_alarms = 0, clear = 0;  // of those that are not hidden
  std::string first_miss;
};

inline IdentifyCount CountIdentified(const IdentifyCase& which, int seeds, std::uint64_t first) {
  const Mapped model(which);
  std::vector<FitResult> fits(static_cast<std::size_t>(seeds));
  ParallelFor(fits.size(), 0, [&](std::size_t i) {
    Rng rng(first + i);
    const Observations data = Record(model, which.truth, TwoLink::Marks(), SparseTrial(), rng);
    FitProblem problem;
    problem.parameters = which.parameters;
    problem.trials.resize(1);
    problem.trials[0].model = &model;
    problem.trials[0].observations = &data;
    FitOptions options;
    options.workers = 1;
    fits[i] = Fit(problem, options);
  });
  IdentifyCount count;
  for (const FitResult& fit : fits) {
    for (std::size_t j = 0; j < which.parameters.size(); ++j) {
      const ParameterEstimate& e = fit.parameters[j];
      const bool combination = fit.Usable() && e.verdict == Verdict::kCombination;
      if (which.with[j].empty()) {
        ++count.clear;
        count.false_alarms += combination ? 1 : 0;
        if (combination && count.first_miss.empty()) count.first_miss = e.reason;
      } else {
        ++count.should;
        const bool good = combination && e.with == which.with[j];
        count.named += good ? 1 : 0;
        if (!good && count.first_miss.empty()) {
          count.first_miss = which.parameters[j].name + ": " + Name(e.verdict) + ", " + e.reason +
                             " | " + fit.message;
        }
      }
    }
  }
  return count;
}

}  // namespace unfurl::correlate
