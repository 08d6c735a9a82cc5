#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/text.h"
#include "study/scene_cost.h"

namespace unfurl::study {
namespace {

// Times that are closer than so many standard errors are the same.
constexpr double kAlikeErrors = 2.0;

using CostLines = std::vector<std::size_t>;

std::size_t WorstOf(const CostPoint& point, const CostLines& lines) {
  return *std::max_element(lines.begin(), lines.end(), [&](std::size_t a, std::size_t b) {
    return point.errors[a].rms < point.errors[b].rms;
  });
}

double ErrorIn(const CostPoint& point, const CostLines& lines) {
  return point.errors[WorstOf(point, lines)].rms;
}

const CostPoint* CheapestOf(const SceneCost& cost, double error, const CostLines& lines) {
  if (lines.empty()) return nullptr;
  const auto serves = [&](const CostPoint& p) { return p.usable && ErrorIn(p, lines) <= error; };
  const CostPoint* fastest = nullptr;
  for (const CostPoint& p : cost.points) {
    if (serves(p) && (fastest == nullptr || p.seconds < fastest->seconds)) fastest = &p;
  }
  const CostPoint* best = fastest;
  for (const CostPoint& p : cost.points) {
    if (!serves(p)) continue;
    const double apart = std::hypot(p.scatter, fastest->scatter);
    if (p.seconds - fastest->seconds <= kAlikeErrors * apart &&
        ErrorIn(p, lines) < ErrorIn(*best, lines)) {
      best = &p;
    }
  }
  return best;
}

}  // namespace

std::string CostPercent(double error) {
  if (!std::isfinite(error)) return "-";
  const double percent = 100.0 * error;
  // A part in a million is the least that reads as a share of a hundred.
  return percent < 1e-4 ? fmt::format("{:.1e} %", percent) : fmt::format("{:.3g} %", percent);
}

std::string CostSetting::Name() const {
  const std::string how = fmt::format("{}, rtol {:g}", method, tolerance);
  return beams.empty() ? how : beams + "; " + how;
}

std::string CostSetting::SetText() const {
  std::string out;
  for (const std::string& s : set) {
    const bool plain = s.find_first_of(" '\"\\$`&|;<>()*?[]#~!{}") == std::string::npos;
    std::string quoted = plain ? s : "'";
    for (const char c : plain ? std::string() : s) {
      quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
    }
    out += (out.empty() ? "--set " : " --set ") + quoted + (plain ? "" : "'");
  }
  return out;
}

const CostPoint* Cheapest(const SceneCost& cost, double error, int line) {
  if (line >= 0) return CheapestOf(cost, error, {static_cast<std::size_t>(line)});
  std::vector<std::size_t> settled;
  for (std::size_t l = 0; l < cost.lines.size(); ++l) {
    if (cost.lines[l].settled) settled.push_back(l);
  }
  return CheapestOf(cost, error, settled);
}

std::vector<CostCounsel> CostCounsels(const SceneCost& cost) {
  std::vector<CostCounsel> advice;
  for (const double target : kCostTargets) {
    std::vector<std::size_t> reached;
    std::vector<std::string> missing;
    for (std::size_t l = 0; l < cost.lines.size(); ++l) {
      if (!cost.lines[l].settled) continue;
      if (CheapestOf(cost, target, {l}) != nullptr) {
        reached.push_back(l);
      } else {
        missing.push_back(cost.lines[l].quantity.name);
      }
    }
    const std::string aim = fmt::format("An error of {:g} %", 100.0 * target);
    const CostPoint* best = CheapestOf(cost, target, reached);
    if (best == nullptr) {
      advice.push_back({fmt::format("{}: none of these settings has so little{}", aim,
                                    reached.empty() ? "" : " in all lines together"),
                        ""});
      continue;
    }
    const CostLine& worst = cost.lines[WorstOf(*best, reached)];
    advice.push_back(
        {fmt::format(
             "{} or less in all lines{} takes {:.3g} s with {} (the largest, of {}: {})", aim,
             missing.empty() ? "" : " but " + JoinWords(missing) + ", where none of these reaches it,",
             best->seconds, best->setting.Name(), worst.quantity.name,
             CostPercent(ErrorIn(*best, reached))),
         best->setting.SetText()});
  }
  for (const CostLine& line : cost.lines) {
    if (line.settled) continue;
    advice.push_back(
        {fmt::format("{}: {}; nothing can be said of its error", line.quantity.name,
                     cost.reference_cut ? "the budget left too few meshes, or they come to no end"
                                        : "finer meshes come to no end"),
         ""});
  }
  return advice;
}

std::vector<std::string> CostAdvice(const SceneCost& cost) {
  std::vector<std::string> lines;
  for (const CostCounsel& c : CostCounsels(cost)) {
    lines.push_back(c.set.empty() ? c.words : c.words + ": " + c.set);
  }
  return lines;
}

}  // namespace unfurl::study
