#include "correlate/fit/cost.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace unfurl::correlate {
namespace {

constexpr double kResolved = 2.0;  // times the floor: smaller errors are not told apart from it
constexpr double kTargets[] = {1e-2, 1e-3, 1e-4};
constexpr double kSameError = 1.1;  // ratio of errors that a tenfold tolerance must beat to matter

double Range(const std::vector<double>& x, const std::vector<double>& y) {
  const auto [x0, x1] = std::minmax_element(x.begin(), x.end());
  const auto [y0, y1] = std::minmax_element(y.begin(), y.end());
  return x.empty() ? 0.0 : std::hypot(*x1 - *x0, *y1 - *y0);
}

std::string Percent(double error) {
  return error < 1e-4 ? fmt::format("{:.1e}", error) : fmt::format("{:.3g} %", 100.0 * error);
}

}  // namespace

std::string CostSetting::Name() const {
  std::string name = fmt::format("{}, rtol {:g}", method, tolerance);
  if (mesh > 0) name += fmt::format(", {} segments", mesh);
  return name;
}

CostPoint CompareCost(const CostRun& run, const CostRun& reference) {
  CostPoint point{run.setting, run.usable, run.message, run.seconds};
  if (!run.usable) return point;
  if (run.x.size() != reference.x.size()) {
    throw Error("the runs follow different points", run.setting.Name(), "give the same points");
  }
  double widest = 0.0;
  for (std::size_t k = 0; k < reference.x.size(); ++k) {
    widest = std::max(widest, Range(reference.x[k], reference.y[k]));
  }
  if (!(widest > 0.0)) return point;  // nothing moves: there is no error to speak of
  for (std::size_t k = 0; k < run.x.size(); ++k) {
    const std::size_t n = reference.x[k].size();
    if (run.x[k].size() != n) {
      throw Error("the runs have different stamps", run.setting.Name(), "sample them alike");
    }
    double sum = 0.0, largest = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const double d = std::hypot(run.x[k][i] - reference.x[k][i], run.y[k][i] - reference.y[k][i]);
      sum += d * d;
      largest = std::max(largest, d);
    }
    const double own = Range(reference.x[k], reference.y[k]);
    const double range = own >= kStill * widest ? own : widest;
    point.rms = std::max(point.rms, std::sqrt(sum / static_cast<double>(n)) / range);
    point.largest = std::max(point.largest, largest / range);
  }
  return point;
}

CostStudy StudyCost(const std::vector<CostRun>& runs, const CostRun& reference,
                    const CostRun* second) {
  CostStudy study;
  study.reference = reference.setting;
  if (second != nullptr && second->usable) {
    study.second = second->setting;
    study.floor = CompareCost(*second, reference).rms;
  }
  for (const CostRun& run : runs) study.points.push_back(CompareCost(run, reference));
  for (CostPoint& p : study.points) {
    if (!p.usable) continue;
    p.on_front = std::none_of(study.points.begin(), study.points.end(), [&](const CostPoint& q) {
      return q.usable && q.seconds <= p.seconds && q.rms <= p.rms &&
             (q.seconds < p.seconds || q.rms < p.rms);
    });
  }
  return study;
}

const CostPoint* Cheapest(const CostStudy& study, double error) {
  const CostPoint* best = nullptr;
  for (const CostPoint& p : study.points) {
    if (!p.usable || p.rms > error) continue;
    if (best == nullptr || p.seconds < best->seconds) best = &p;
  }
  return best;
}

std::vector<std::string> CostAdvice(const CostStudy& study) {
  std::vector<std::string> advice;
  for (const double target : kTargets) {
    if (study.floor >= 0.0 && target < kResolved * study.floor) {
      advice.push_back(fmt::format(
          "{} cannot be judged here: the two finest runs ({}; {}) themselves differ by {}.",
          Percent(target), study.reference.Name(), study.second.Name(), Percent(study.floor)));
      break;
    }
    const CostPoint* best = Cheapest(study, target);
    if (best == nullptr) {
      advice.push_back(fmt::format("{}: none of these settings.", Percent(target)));
      break;
    }
    advice.push_back(fmt::format("{}: {}, {:.3g} s (error {}).", Percent(target),
                                 best->setting.Name(), best->seconds, Percent(best->rms)));
  }
  // Where the mesh is what is left, a tighter tolerance is wasted.
  for (const CostPoint& tight : study.points) {
    if (!tight.usable || tight.setting.mesh == 0 || tight.setting.mesh == study.reference.mesh) {
      continue;
    }
    const auto looser =
        std::find_if(study.points.begin(), study.points.end(), [&](const CostPoint& q) {
          return q.usable && q.setting.method == tight.setting.method &&
                 q.setting.mesh == tight.setting.mesh &&
                 q.setting.tolerance > tight.setting.tolerance && q.rms < kSameError * tight.rms &&
                 q.seconds < tight.seconds;
        });
    if (looser == study.points.end()) continue;
    advice.push_back(fmt::format(
        "With {} segments the mesh is what is left ({}): a tolerance below {:g} is wasted on it.",
        tight.setting.mesh, Percent(tight.rms), looser->setting.tolerance));
    break;
  }
  return advice;
}

}  // namespace unfurl::correlate
