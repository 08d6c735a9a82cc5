#include <fmt/format.h>

#include <cmath>

#include "base/count.h"
#include "campaign/statistics/rare_failure.h"

namespace unfurl::campaign {

// What makes the number one not to rely on; and what a reader must know.
void RareFailure::Judge() {
  RareFailureResult& r = result_;
  r.usable = true;
  const auto fault = [&](const std::string& why) {
    r.usable = false;
    r.notes.push_back(why);
  };
  const SubsetResult& subset = subsets_[0];
  if (subset.end == SubsetEnd::kStalled) {
    r.notes.emplace_back(
        "margins have too many ties to climb by: all other runs are random ones; a margin that "
        "says how far from failure a run is needs far fewer of them");
    if (r.probability <= 0.0) fault("no run failed: the interval's upper end is all that is known");
  }
  if (subset.end == SubsetEnd::kOutOfRuns) {
    fault(fmt::format("the runs did not reach failures: the probability is below {:.2g}",
                      subset.probability));
  }
  if (lost_repeat_) {
    fault("a second subset simulation did not reach the failures that the first found");
  }
  if (r.failed > 0) {
    const std::string counts = fmt::format(
        "{} of {} gave no value and count as no failure; were all of them failures, the "
        "probability "
        "would be up to {:.2g}",
        r.failed, Counted(r.runs, "run"), r.with_failed);
    if (r.with_failed > r.interval.high) {
      fault(counts);
    } else {
      r.notes.push_back(counts);
    }
  }
  if (r.method == RareMethod::kSubset) JudgeChains();
  if (r.method != RareMethod::kImportance) return;
  // Two independent estimates: apart by three standard deviations once in 370 times by chance.
  const double apart = std::abs(std::log(r.importance / subset.probability));
  const double sigma = std::sqrt(std::log1p(subset.variation * subset.variation) +
                                 std::log1p(r.variation * r.variation));
  if (apart > 3.0 * sigma) {
    fault(
        fmt::format("importance sampling says {:.2g} and the subset simulation {:.2g}: one has "
                    "missed a region of failures",
                    r.importance, subset.probability));
  }
}

void RareFailure::JudgeChains() {
  // Below it most chains have stayed where they began; 0.44 is what the spread aims at.
  constexpr double kStuck = 0.1;
  for (const SubsetResult& s : subsets_) {
    for (std::size_t k = 1; k < s.levels.size(); ++k) {
      if (s.levels[k].acceptance >= kStuck) continue;
      result_.usable = false;
      result_.notes.push_back(
          fmt::format("chains of level {} accepted {:.0f}% of their candidates: "
                      "they have not seen their level",
                      k + 1, 100.0 * s.levels[k].acceptance));
    }
  }
  constexpr double kFactor = 1.5;  // what is asked of 5000 runs at 1e-4
  if (result_.probability > 0.0 && result_.interval.high > kFactor * result_.probability) {
    result_.notes.push_back(fmt::format(
        "importance sampling had no proposal with even weights, and subset simulation alone knows "
        "the probability to a factor of {:.2g}",
        result_.interval.high / result_.probability));
  }
}

}  // namespace unfurl::campaign
