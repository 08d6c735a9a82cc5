#include "campaign/statistics/morris.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/count.h"
#include "base/error.h"
#include "base/statistics.h"

namespace unfurl::campaign {

namespace {

// Effects below which neither a mean nor a scatter is known to a factor of two.
constexpr std::size_t kFewest = 4;

std::vector<std::vector<double>> EffectsOf(const Design& design, std::span<const double> values,
                                           MorrisScreening* screening) {
  const auto d = static_cast<std::size_t>(design.spec().dimensions);
  std::vector<std::vector<double>> effects(d);
  std::vector<double> before(d), after(d);
  for (std::uint64_t t = 0; t < screening->trajectories; ++t) {
    const std::vector<int> steps = MorrisSteps(design.spec(), t);
    for (std::size_t k = 0; k < d; ++k) {
      const std::uint64_t to = t * design.row() + static_cast<std::uint64_t>(steps[k]);
      const double change = values[to] - values[to - 1];
      if (!std::isfinite(change)) {
        ++screening->dropped;
        continue;
      }
      design.Point(to - 1, before);
      design.Point(to, after);
      effects[k].push_back(change / (after[k] - before[k]));
    }
  }
  return effects;
}

MorrisEffect EffectOf(const std::vector<double>& effects) {
  MorrisEffect e;
  e.n = effects.size();
  if (e.n < 2) return e;
  const double n = static_cast<double>(e.n);
  std::vector<double> absolute;
  absolute.reserve(effects.size());
  for (double x : effects) absolute.push_back(std::abs(x));
  e.mu = Mean(effects);
  e.sigma = std::sqrt(Variance(effects));
  e.mu_error = e.sigma / std::sqrt(n);
  e.mu_star = Mean(absolute);
  e.mu_star_error = std::sqrt(Variance(absolute) / n);
  // Standard error of a standard deviation from the fourth moment [Stuart and Ord 1994].
  if (e.sigma > 0.0) {
    double fourth = 0.0;  // over sigma^4
    for (double x : effects) fourth += std::pow((x - e.mu) / e.sigma, 4.0) / n;
    e.sigma_error = e.sigma * std::sqrt(std::max(fourth - 1.0, 0.0) / n) / 2.0;
  }
  return e;
}

void Rank(std::vector<MorrisEffect>* inputs) {
  std::vector<std::size_t> order(inputs->size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return (*inputs)[a].mu_star > (*inputs)[b].mu_star;
  });
  for (std::size_t r = 0; r < order.size(); ++r) {
    MorrisEffect& e = (*inputs)[order[r]];
    e.rank = static_cast<int>(r) + 1;
    for (std::size_t s = r + 1; s < order.size(); ++s) {
      const MorrisEffect& worse = (*inputs)[order[s]];
      const double error = std::hypot(e.mu_star_error, worse.mu_star_error);
      e.tied += e.mu_star - worse.mu_star <= 2.0 * error ? 1 : 0;
    }
  }
}

}  // namespace

MorrisScreening ScreenMorris(const Design& design, std::span<const double> values) {
  if (design.spec().kind != DesignKind::kMorris || values.size() > design.size()) {
    throw Error(fmt::format("{} values for a Morris screening", values.size()), "",
                "give the runs of a Morris design, in the order of their index");
  }
  MorrisScreening screening;
  screening.trajectories = values.size() / design.row();
  const auto effects = EffectsOf(design, values, &screening);
  screening.usable = screening.trajectories >= kFewest;
  if (!screening.usable) {
    screening.notes.push_back(fmt::format(
        "{}; {} are the least",
        screening.trajectories == 1 ? "1 trajectory"
                                    : fmt::format("{} trajectories", screening.trajectories),
        kFewest));
  }
  for (std::size_t k = 0; k < effects.size(); ++k) {
    screening.inputs.push_back(EffectOf(effects[k]));
    if (effects[k].size() >= kFewest || screening.trajectories < kFewest) continue;
    screening.usable = false;
    screening.notes.push_back(fmt::format("input {} has {}: its runs failed", k + 1,
                                          Counted(effects[k].size(), "effect")));
  }
  if (screening.dropped > 0) {
    screening.notes.push_back("lost to failed runs: " + Counted(screening.dropped, "effect"));
  }
  Rank(&screening.inputs);
  return screening;
}

}  // namespace unfurl::campaign
