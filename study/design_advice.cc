#include "study/design_advice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/number.h"
#include "base/sentence.h"
#include "base/text.h"

namespace unfurl::study {

namespace {

// Plans that take errors down by no more than this beyond the same trial once more are no better:
// standard errors are known to some per cent.
constexpr double kNoBetter = 0.95;

std::vector<std::size_t> WantedOf(const StudyDesign& d) {
  std::vector<std::size_t> out;
  for (std::size_t j = 0; j < d.tells.parameters.size(); ++j) {
    const bool counts =
        std::find(d.wanted.begin(), d.wanted.end(), d.tells.parameters[j]) != d.wanted.end();
    if (counts) out.push_back(j);
  }
  return out;
}

struct Plan {
  const DesignCase* of = nullptr;
  std::string words;
  double factor = std::numeric_limits<double>::infinity();  // of errors, geometric mean [-]
};

// "0.60 of today's (clearance) and 0.58 (damping)".
std::string Become(const StudyDesign& d, const DesignCase& plan) {
  std::vector<std::string> out;
  for (const std::size_t j : WantedOf(d)) {
    out.push_back(fmt::format("{}{} ({})", Number(plan.together[j] / d.now[j], 2),
                              out.empty() ? " of today's" : "", d.tells.parameters[j]));
  }
  return JoinWords(out);
}

Plan BestPlan(const StudyDesign& d) {
  Plan best;
  const auto weigh = [&](const DesignCase& plan, const std::string& words) {
    const double factor = FactorOf(d, plan);
    if (factor < best.factor) best = {&plan, words, factor};
  };
  if (!d.cycle.empty()) {
    weigh(d.schedule,
          fmt::format("a trial with the strobe's cycle {}", fmt::join(d.schedule.cycle, " ")));
  }
  for (const DesignCase& c : d.marks) {
    weigh(c, c.name == kBestOfAll
                 ? fmt::format("a trial with the best of all marks, in the cycle {}",
                               fmt::join(c.cycle, " "))
             : c.name == kAllOfThese ? "a trial with all of the candidate marks"
                                     : fmt::format("a trial with the mark {}", c.name));
  }
  for (const DesignCase& c : d.channels) {
    weigh(c, c.name == kAllOfThese ? "a trial with all of the candidate instruments"
                                   : fmt::format("a trial with {} beside", c.name));
  }
  for (const DesignCase& c : d.trials) weigh(c, fmt::format("the trial {}", c.name));
  const double again = FactorOf(d, d.again);
  if (!(best.factor < kNoBetter * again)) {
    best = {&d.again, "the same once more, as nothing else that was weighed does better", again};
  }
  return best;
}

}  // namespace

double FactorOf(const StudyDesign& d, const DesignCase& plan) {
  const std::vector<std::size_t> wanted = WantedOf(d);
  if (!plan.message.empty() || plan.together.size() < d.now.size() || wanted.empty()) {
    return std::numeric_limits<double>::infinity();
  }
  double sum = 0.0;
  for (const std::size_t j : wanted) sum += std::log(plan.together[j] / d.now[j]);
  return std::exp(sum / static_cast<double>(wanted.size()));
}

std::string Advice(const StudyDesign& d) {
  std::vector<std::string> model;
  bool first = true;
  for (const std::size_t j : WantedOf(d)) {
    const correlate::ParameterEstimate& e = d.fit.result.parameters[j];
    first = first && e.sigma_model > e.sigma_data;
    model.push_back(
        fmt::format("{} ({})", Number(e.sigma_model / e.sigma_data, 2), d.tells.parameters[j]));
  }
  const Plan best = BestPlan(d);
  std::string next;
  if (std::isfinite(best.factor)) {
    next = fmt::format("measure {}: the data's standard errors become {}.", best.words,
                       Become(d, *best.of));
  }
  if (!first || model.empty()) return Capitalised(next);
  return fmt::format(
      "Refine the model first: its own error is {} times what the data leave open.{}",
      fmt::join(model, ", "), next.empty() ? "" : " Then " + next);
}

}  // namespace unfurl::study
