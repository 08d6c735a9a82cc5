#include "correlate/fit/start_choice.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace unfurl::correlate {

namespace {

// Two points nearer than this part of every parameter's range lead to the same minimum: a
// thirty-third of a range holds one point of a hypercube of 32.
constexpr double kNear = 0.05;

bool Near(const std::vector<Parameter>& parameters, const std::vector<double>& a,
          const std::vector<double>& b) {
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    const Parameter& p = parameters[j];
    const double range = ToInternal(p, p.high) - ToInternal(p, SearchLow(p));
    if (std::abs(ToInternal(p, a[j]) - ToInternal(p, b[j])) > kNear * range) return false;
  }
  return true;
}

}  // namespace

std::vector<std::vector<double>> PointsToScreen(const FitProblem& problem,
                                                const SearchOptions& search) {
  std::vector<std::vector<double>> points(1);
  for (const Parameter& p : problem.parameters) points[0].push_back(p.start);
  if (search.screened > 0) {
    for (auto& point : LatinHypercube(problem.parameters, static_cast<std::size_t>(search.screened),
                                      search.seed)) {
      points.push_back(std::move(point));
    }
  }
  return points;
}

std::vector<std::size_t> ChooseCandidates(const std::vector<Candidate>& candidates, int wanted) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (candidates[i].usable) order.push_back(i);
  }
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return candidates[a].misfit < candidates[b].misfit;
  });
  const auto count = static_cast<std::size_t>(std::max(1, wanted));
  if (order.size() > count) {
    order.resize(count);
    const bool own = std::find(order.begin(), order.end(), std::size_t{0}) != order.end();
    if (candidates[0].usable && !own) order.back() = 0;
  }
  return order;
}

std::vector<std::size_t> SeparatePoints(const std::vector<Parameter>& parameters,
                                        const std::vector<std::vector<double>>& points,
                                        const std::vector<double>& costs, std::size_t wanted) {
  std::vector<std::size_t> order(points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return costs[a] < costs[b]; });
  std::vector<std::size_t> out;
  for (std::size_t i : order) {
    if (out.size() >= wanted || !std::isfinite(costs[i])) break;
    const bool taken = std::any_of(out.begin(), out.end(), [&](std::size_t k) {
      return Near(parameters, points[i], points[k]);
    });
    if (!taken) out.push_back(i);
  }
  return out;
}

void SortByCost(std::vector<StartResult>* starts) {
  std::stable_sort(starts->begin(), starts->end(), [](const StartResult& a, const StartResult& b) {
    if ((a.cost < 0.0) != (b.cost < 0.0)) return b.cost < 0.0;
    return a.cost < b.cost;
  });
}

}  // namespace unfurl::correlate
