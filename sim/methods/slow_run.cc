#include "sim/methods/slow_run.h"

#include <fmt/format.h>

#include <algorithm>

#include "sim/dynamics/observables.h"

namespace unfurl::sim {
namespace {

std::string RemedyFor(StepLimit limit, const SimulateOptions& options) {
  switch (limit) {
    case StepLimit::kStability:
      if (options.method != Method::kAuto || options.order != 0) {
        return "method \"auto\" takes implicit steps where stability limits the explicit ones";
      }
      return "fewer segments or a lower order there, or a larger rtol, shorten it";
    case StepLimit::kMaxStep:
      return "a longer max_step shortens it";
    case StepLimit::kEdge:
      return "functions of time with fewer edges or knots shorten it";
    case StepLimit::kFunction:
      return "functions of time that swing less fast, or their means, shorten it";
    case StepLimit::kEvent:
    case StepLimit::kContactExit:
      return "these are impacts: contacts with more damping, or a larger rtol, shorten it";
    default:
      return "a larger rtol, fewer segments or a lower order of the beams shorten it";
  }
}

}  // namespace

std::string AboutSlowRun(const Model& model, const SimulateOptions& options,
                         const SimulateReport& report, double seconds) {
  const auto most = std::max_element(report.limited.begin(), report.limited.end());
  const auto limit = static_cast<StepLimit>(most - report.limited.begin());
  const double share = report.steps > 0
                           ? 100.0 * static_cast<double>(*most) / static_cast<double>(report.steps)
                           : 0.0;
  const auto worst = std::max_element(report.worst_bodies.begin(), report.worst_bodies.end());
  std::string where;
  if (worst != report.worst_bodies.end() && *worst > 0) {
    where = ", most at " +
            NameOfRigidBody(model, static_cast<int>(worst - report.worst_bodies.begin()));
  }
  return fmt::format(
      "at its present pace this run takes about {:.0f} s: {:.0f}% of its steps are limited by "
      "{}{}; {}",
      seconds, share, LimitName(limit), where, RemedyFor(limit, options));
}

}  // namespace unfurl::sim
