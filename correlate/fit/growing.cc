#include "correlate/fit/growing.h"

#include <algorithm>
#include <limits>

#include "correlate/fit/search.h"

namespace unfurl::correlate {

std::vector<FitOptions> GrowingHorizons(const FitProblem& problem, const FitOptions& options) {
  constexpr double kShorter = 0.5;  // from one to the next: leads at most twice as far as it need
  constexpr double kGrowth = 1.6;   // as by impacts
  std::vector<FitOptions> out;
  if (!options.stages.empty() || options.stages_by_impacts) return out;
  // The shortest record, so that no trial is without what leads; on the model's clock it begins at
  // its release, if nothing is said.
  double length = std::numeric_limits<double>::infinity(), most = 0.0;
  std::size_t fewest = std::numeric_limits<std::size_t>::max();
  for (const FitTrial& trial : problem.trials) {
    const Observations& o = *trial.observations;
    const bool told = o.placement.offset.Told();
    const double begin = told ? o.placement.offset.mean : o.Start();
    length = std::min(length, o.End() - begin);
    most = std::max(most, o.End() - begin);
    fewest = std::min(fewest, o.readings());
  }
  if (!(length > 0.0)) return out;
  const double least = static_cast<double>(FewestOfHorizon(problem, options));
  double part = kShorter;
  while (part * static_cast<double>(fewest) >= least) {
    FitOptions grown = options;
    double end = part * length;
    while (end < most) {
      grown.stages.push_back(end);
      end *= kGrowth;
    }
    out.push_back(std::move(grown));
    part *= kShorter;
  }
  return out;
}

}  // namespace unfurl::correlate
