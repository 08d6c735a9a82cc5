#include "correlate/fit/other_clocks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/number.h"
#include "correlate/align/nuisance.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

enum Side : std::size_t { kEarlier = 0, kLater = 1 };
constexpr std::array<Side, 2> kSides = {kLater, kEarlier};

// The standard error of a trial's offset, of white residuals [s]; 0: it is not fitted.
double OffsetSigma(const Observations& o, const RegistrationOptions& options,
                   const RegistrationFit& at) {
  RegistrationOptions all = WithPlacement(options, o);
  all.with_others = true;
  const std::vector<Nuisance> nuisances = Nuisances(all, o);
  for (std::size_t i = 0; i < nuisances.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    if (nuisances[i].kind == Nuisance::Kind::kOffset && k < at.sigma.size()) return at.sigma(k);
  }
  return 0.0;
}

using ClockNeighbours = std::array<std::optional<Alignment>, 2>;  // by side

// The best place to either side of where a trial lies.
ClockNeighbours NeighboursOf(const Observations& o, const SampledModel& model, AlignOptions options,
                             const RegistrationFit& at) {
  // Nearer than half a step, or than ten standard errors (none in 1e22 lies beyond), is no other
  // place: a motion that a record shows does not repeat itself within two of its steps.
  constexpr double kSteps = 0.5, kSigmas = 10.0;
  const double offset = at.at.offset;
  options.search.known = {offset};
  options.search.near =
      std::max(kSteps * o.ShortestStep(), kSigmas * OffsetSigma(o, options.registration, at));
  ClockNeighbours out;
  for (const Side side : kSides) {
    AlignOptions there = options;
    (side == kLater ? there.search.low : there.search.high) = offset;
    Alignment found = Align(o, model, there);
    const bool beyond = (found.at.offset > offset) == (side == kLater);
    if (found.Usable() && beyond && !options.search.IsKnown(found.at.offset)) {
      out[side] = std::move(found);
    }
  }
  return out;
}

// Of the values at the same offsets those within the intervals, and those that another already has.
void DropSameValues(FitResult* r) {
  std::vector<OtherClock> kept;
  for (OtherClock& other : r->other_clocks) {
    const auto same = [&](std::span<const double> theta) {
      for (std::size_t j = 0; j < r->parameters.size(); ++j) {
        const ParameterEstimate& e = r->parameters[j];
        const bool below = other.theta[j] - theta[j] < e.all95.low - e.value;
        const bool above = other.theta[j] - theta[j] > e.all95.high - e.value;
        if (below || above) return false;  // an open side is NaN
      }
      return true;
    };
    const bool known =
        same(r->Theta()) || std::any_of(kept.begin(), kept.end(), [&](const OtherClock& k) {
          return k.elsewhere == other.elsewhere && same(k.theta);
        });
    if (other.elsewhere || !known) kept.push_back(std::move(other));
  }
  r->other_clocks = std::move(kept);
}

}  // namespace

std::vector<Candidate> OtherPlaces(const FitProblem& problem, const FitOptions& options,
                                   const Candidate& from, const std::vector<double>& theta,
                                   const ReducedProblem::Point& point, Evaluator& evaluator) {
  FitOptions whole = options;  // late motion is what tells, once the parameters are near
  whole.stages.clear();
  whole.stages_by_impacts = false;
  std::vector<Evaluator::Request> requests;
  std::vector<Stamps> stamps;
  for (std::size_t t = 0; t < problem.trials.size(); ++t) {
    const Observations& o = *problem.trials[t].observations;
    if (!WithPlacement(options.align.registration, o).fit_offset) continue;
    requests.push_back({t, theta, "other offsets"});
    stamps.push_back(AlignmentGrid(o, whole));
  }
  const std::vector<Evaluator::Answer> answers = evaluator.EvaluateAt(requests, stamps);
  std::vector<ClockNeighbours> found(problem.trials.size());
  for (std::size_t i = 0; i < requests.size(); ++i) {
    if (answers[i]->status != ModelStatus::kGood) continue;
    const std::size_t t = requests[i].trial;
    found[t] = NeighboursOf(*problem.trials[t].observations, SampledModel(stamps[i], *answers[i]),
                            options.align, point.registration[t]);
  }
  Candidate here = from;
  here.theta = theta;
  for (std::size_t t = 0; t < here.alignment.size(); ++t) {
    here.alignment[t].at = point.registration[t].at;
    here.alignment[t].drift = point.registration[t].at.drift;
  }
  std::vector<Candidate> out;
  for (const Side side : kSides) {
    Candidate all = here;
    std::size_t moved = 0;
    for (std::size_t t = 0; t < found.size(); ++t) {
      if (!found[t][side]) continue;
      all.alignment[t] = *found[t][side];
      ++moved;
    }
    if (moved > 1) out.push_back(std::move(all));
    for (std::size_t t = 0; t < found.size(); ++t) {
      if (!found[t][side]) continue;
      out.push_back(here);
      out.back().alignment[t] = *found[t][side];
    }
  }
  return out;
}

void OpenByOtherClocks(const FitProblem& problem, FitResult* r) {
  constexpr double kOpen = std::numeric_limits<double>::quiet_NaN();
  DropSameValues(r);
  for (std::size_t j = 0; j < r->parameters.size(); ++j) {
    ParameterEstimate& e = r->parameters[j];
    const std::string unit = UnitAfter(problem.parameters[j].unit);
    for (const OtherClock& other : r->other_clocks) {
      if (other.deviance > kDeviance95 * std::max(1.0, e.profile.dispersion)) continue;
      const double there = other.theta[j];
      const bool below = there<e.all95.low, above = there> e.all95.high;
      if (!below && !above) continue;
      if (below) e.all95.low = e.data95.low = kOpen;
      if (above) e.all95.high = e.data95.high = kOpen;
      if (!other.elsewhere) {
        if (e.verdict == Verdict::kNotDetermined || e.verdict == Verdict::kCombination) continue;
        e.verdict = Verdict::kNotDetermined;
        e.reason = fmt::format(
            "{}{} explains the data as well: between the samples the model moves by what they do "
            "not show",
            NumberWithError(there, e.sigma), unit);
        continue;
      }
      if (std::find(e.with.begin(), e.with.end(), "time offset") != e.with.end()) continue;
      e.with.emplace_back("time offset");
      e.verdict = Verdict::kCombination;
      e.reason = fmt::format(
          "determined only in combination with the time offset: {}{} with another one explains the "
          "data as well",
          NumberWithError(there, e.sigma), unit);
    }
  }
}

}  // namespace unfurl::correlate
