#include "study/trials_apart.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "base/number.h"
#include "base/text.h"
#include "correlate/align/nuisance.h"
#include "correlate/compare/explanations.h"
#include "correlate/fit/screening.h"

namespace unfurl::study {

namespace {

using correlate::Explained;
using correlate::FitProblem;
using correlate::FitResult;

// Standard errors from what was said, or from no drift, beyond which a clock is another one: one in
// 16 000 lies there.
constexpr double kOtherClock = 4.0;

class Apart {
 public:
  Apart(const FitProblem& problem, const correlate::FitOptions& options, const FitResult& r)
      : problem_(problem), options_(NoSearch(options)), r_(r) {}

  TrialsApart Find() {
    const std::size_t n = problem_.trials.size();
    std::vector<std::size_t> candidates;
    std::vector<FitResult> without(n);
    for (std::size_t k = 0; k < n; ++k) {
      FitProblem rest = FromEstimate(problem_, r_);
      rest.trials.erase(rest.trials.begin() + static_cast<std::ptrdiff_t>(k));
      without[k] = correlate::Fit(rest, options_);
      if (ExplainsAll(without[k])) candidates.push_back(k);
    }
    if (candidates.size() == 1) return Alone(candidates[0], without[candidates[0]]);
    if (candidates.size() == 2 && n == 2) return OneOfTwo(without);
    return {};
  }

 private:
  // The clock with which trial k is explained by the others' values, in words; empty: none.
  std::string ClockOf(std::size_t k, const FitResult& others) const {
    FitProblem own = problem_;
    own.trials = {problem_.trials[k]};
    correlate::Observations free = *problem_.trials[k].observations;
    free.placement.offset = free.placement.drift = correlate::Prior::Free();
    own.trials[0].observations = &free;
    for (std::size_t j = 0; j < own.parameters.size(); ++j) {
      correlate::Parameter& p = own.parameters[j];
      p.start = p.prior_mean = others.parameters[j].value;
      p.prior_sigma = others.parameters[j].sigma;
      p.has_prior = p.prior_sigma > 0.0;
    }
    const FitResult r = correlate::Fit(own, options_);
    const bool held = std::none_of(r.stated.begin(), r.stated.end(),
                                   [](const auto& s) { return s.contradicted; });
    if (!ExplainsAll(r) || !held) return {};
    std::vector<std::string> words;
    const correlate::TrialResult& t = r.trials[0];
    const correlate::Prior& said = problem_.trials[k].observations->placement.offset;
    for (std::size_t i = 0; i < t.nuisances.size(); ++i) {
      using Kind = correlate::Nuisance::Kind;
      const Kind kind = t.nuisances[i].kind;
      const double sigma = t.nuisance_sigma(static_cast<Eigen::Index>(i));
      const double drift = t.at.drift, late = t.at.offset - said.mean;
      if (kind == Kind::kDrift && std::abs(drift) > kOtherClock * sigma) {
        words.push_back(fmt::format("runs {} by {} parts in a million",
                                    drift > 0.0 ? "fast" : "slow",
                                    NumberWithError(1e6 * std::abs(drift), 1e6 * sigma)));
      }
      if (kind == Kind::kOffset && said.Told() &&
          std::abs(late) > kOtherClock * std::hypot(sigma, said.sigma)) {
        words.push_back(fmt::format("shows {} s at the release, where {:.6g} s was said",
                                    NumberWithError(t.at.offset, sigma), said.mean));
      }
    }
    return JoinWords(words);
  }

  TrialsApart Alone(std::size_t k, const FitResult& others) const {
    const std::string& name = problem_.trials[k].name;
    TrialsApart out;
    out.verdict = fmt::format("the data of {} beside the others'", name);
    const std::string clock = ClockOf(k, others);
    out.reasons.push_back(fmt::format(
        "Without {} the others are explained ({}), beside it they are not. {}", name,
        ValuesOf(problem_, others),
        clock.empty()
            ? "No clock makes up for it: look at what the study says of it (set, tracks, marks)."
            : fmt::format("With a clock that {}, it would go with them: look at that clock, or say "
                          "what is known of it (trial.offset, trial.drift).",
                          clock)));
    return out;
  }

  TrialsApart OneOfTwo(const std::vector<FitResult>& without) const {
    TrialsApart out;
    out.verdict = "the two trials together";
    std::string words = fmt::format(
        "Each of the two trials is explained by itself, and together they are not: {} wants {}, {} "
        "wants {}. ",
        problem_.trials[0].name, ValuesOf(problem_, without[1]), problem_.trials[1].name,
        ValuesOf(problem_, without[0]));
    std::vector<std::string> clocks;
    for (std::size_t k = 0; k < 2; ++k) {
      const std::string clock = ClockOf(k, without[k]);
      if (!clock.empty())
        clocks.push_back(fmt::format("one of {} that {}", problem_.trials[k].name, clock));
    }
    words += clocks.empty()
                 ? "No clock makes up for it: look at what the study says of either (set, tracks, "
                   "marks)."
                 : fmt::format("A clock would make up for it: {}. {}", fmt::join(clocks, " or "),
                               clocks.size() > 1
                                   ? "Which of the two is wrong they do not say (trial.drift)."
                                   : "Look at it, or say what is known of it (trial.drift).");
    out.reasons.push_back(std::move(words));
    return out;
  }

  const FitProblem& problem_;
  correlate::FitOptions options_;
  const FitResult& r_;
};

}  // namespace

bool ExplainsAll(const FitResult& r) {
  return r.Usable() && std::none_of(r.trials.begin(), r.trials.end(), [](const auto& t) {
           return t.goodness.outcome == Explained::kNo;
         });
}

std::string ValuesOf(const FitProblem& problem, const FitResult& r) {
  std::vector<std::string> out;
  for (std::size_t j = 0; j < problem.parameters.size(); ++j) {
    const correlate::Parameter& p = problem.parameters[j];
    out.push_back(fmt::format("{} {}{}", p.name,
                              NumberWithError(r.parameters[j].value, r.parameters[j].sigma),
                              UnitAfter(p.unit)));
  }
  return JoinWords(out);
}

FitProblem FromEstimate(const FitProblem& problem, const FitResult& r) {
  FitProblem out = problem;
  for (std::size_t j = 0; j < out.parameters.size(); ++j) {
    out.parameters[j].start = r.parameters[j].value;
  }
  return out;
}

correlate::FitOptions NoSearch(correlate::FitOptions options) {
  options.profile.wanted = false;
  options.search.screened = 0;
  options.search.starts = 1;
  options.where = nullptr;
  options.progress = nullptr;
  return options;
}

TrialsApart FindTrialsApart(const FitProblem& problem, const correlate::FitOptions& options,
                            const FitResult& r) {
  if (problem.trials.size() < 2 || !r.Usable() || ExplainsAll(r)) return {};
  return Apart(problem, options, r).Find();
}

std::vector<std::string> WhyNotAligned(const FitProblem& problem,
                                       const correlate::FitOptions& options, const FitResult& r) {
  std::vector<std::string> out;
  if (r.status != correlate::FitStatus::kNotAligned) return out;
  std::vector<double> theta;
  for (const correlate::Parameter& p : problem.parameters) theta.push_back(p.start);
  for (const correlate::FitTrial& trial : problem.trials) {
    const correlate::Observations& o = *trial.observations;
    const correlate::Stamps grid = correlate::AlignmentGrid(o, options);
    const correlate::Prediction at = trial.model->Evaluate(theta, grid);
    if (at.status != correlate::ModelStatus::kGood) continue;
    const correlate::SampledModel sampled(grid, at);
    const correlate::Alignment alignment = correlate::Align(o, sampled, options.align);
    if (alignment.Usable() || alignment.status == correlate::AlignStatus::kNotConverged) continue;
    if (problem.trials.size() > 1) {
      out.push_back(fmt::format("It is {} that does not lie beside the model.", trial.name));
    }
    correlate::ExplanationOptions ask;
    ask.align = options.align;
    ask.clock = ask.lengths = false;
    for (const correlate::Explanation& e :
         correlate::ExplainDifference(o, sampled, alignment, ask)) {
      if (e.kind == correlate::Explanation::Kind::kNames) out.push_back(e.words);
    }
  }
  return out;
}

}  // namespace unfurl::study
