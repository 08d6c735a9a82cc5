#include "correlate/fit/growing.h"

#include <algorithm>
#include <limits>

#include "correlate/fit/search.h"

namespace unfurl::correlate {

namespace {

// Of the shortest record, so that no trial is without what leads; on the model's clock it begins at
// its release, if nothing is said.
struct Lengths {
  double least = std::numeric_limits<double>::infinity(), most = 0.0;  // [s]
  std::size_t fewest = std::numeric_limits<std::size_t>::max();        // readings

  explicit Lengths(const FitProblem& problem) {
    for (const FitTrial& trial : problem.trials) {
      const Observations& o = *trial.observations;
      const bool told = o.placement.offset.Told();
      const double begin = told ? o.placement.offset.mean : o.Start();
      least = std::min(least, o.End() - begin);
      most = std::max(most, o.End() - begin);
      fewest = std::min(fewest, o.readings());
    }
  }
};

FitOptions Grown(const FitOptions& options, const Lengths& lengths, double part) {
  constexpr double kGrowth = 1.6;  // as by impacts
  FitOptions grown = options;
  double end = part * lengths.least;
  while (end < lengths.most) {
    grown.stages.push_back(end);
    end *= kGrowth;
  }
  return grown;
}

}  // namespace

std::vector<FitOptions> GrowingHorizons(const FitProblem& problem, const FitOptions& options,
                                        bool all) {
  constexpr double kShorter = 0.5;  // from one to the next: leads at most twice as far as it need
  std::vector<FitOptions> out;
  if (!options.stages.empty() || options.stages_by_impacts) return out;
  const Lengths lengths(problem);
  if (!(lengths.least > 0.0)) return out;
  const double least = static_cast<double>(FewestOfHorizon(problem, options)) /
                       static_cast<double>(std::max<std::size_t>(1, lengths.fewest));
  if (all) out.push_back(options);
  double part = kShorter;
  while (part >= least) {
    out.push_back(Grown(options, lengths, part));
    part *= kShorter;
  }
  if (all && least < 1.0) out.push_back(Grown(options, lengths, least));
  return out;
}

}  // namespace unfurl::correlate
