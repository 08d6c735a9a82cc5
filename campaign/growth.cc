#include "campaign/growth.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/text.h"
#include "campaign/answers.h"

namespace unfurl::campaign {

namespace {

constexpr double kLeastGrowth = 1.5;  // of the runs at a time
constexpr double kMostGrowth = 4.0;   // likewise: the first guess may be far off

// What stands between the first "(" and the last ")", at commas.
std::vector<std::string> InParentheses(const std::string& text) {
  const std::size_t open = text.find('('), close = text.rfind(')');
  if (open == std::string::npos || close == std::string::npos || close < open) return {};
  std::vector<std::string> out;
  for (const std::string& part : Split(text.substr(open + 1, close - open - 1), ',')) {
    out.emplace_back(Trim(part));
  }
  return out;
}

bool ParseHalf(const std::string& text, Goal* goal) {
  std::string number(Trim(text));
  goal->relative = number.ends_with("%");
  if (goal->relative) number.pop_back();
  if (!ParseDouble(number, &goal->half) || !std::isfinite(goal->half)) return false;
  if (goal->relative) goal->half /= 100.0;
  return goal->half > 0.0;
}

bool ParseWords(const std::string& text, Goal* goal) {
  std::size_t sign = text.find("+-"), length = 2;
  if (sign == std::string::npos) sign = text.find("\u00b1");
  if (sign == std::string::npos) return false;
  const std::string left(Trim(text.substr(0, sign)));
  const std::vector<std::string> inside = InParentheses(left);
  if (inside.empty() || !ParseHalf(text.substr(sign + length), goal)) return false;
  goal->response = inside[0];
  const std::string name(Trim(left.substr(0, left.find('('))));
  if (name == "P") goal->kind = AnswerKind::kProbability;
  if (name == "mean") goal->kind = AnswerKind::kMean;
  if (name == "quantile") {
    goal->kind = AnswerKind::kQuantile;
    return inside.size() == 2 && ParseDouble(inside[1], &goal->p) && goal->p > 0.0 && goal->p < 1.0;
  }
  return inside.size() == 1 && (name == "P" || name == "mean");
}

// How sharp the answer is now.
RunsEstimate Look(const OpenCampaign& campaign, const Goal& goal, std::size_t response) {
  std::vector<int> blocks, kept;
  std::vector<double> there;
  const std::vector<std::uint64_t> runs = DrawnRuns(campaign.inputs, &blocks);
  const std::vector<double> values = campaign.Values(response);
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (std::isnan(values[runs[i]])) continue;
    there.push_back(values[runs[i]]);
    if (!blocks.empty()) kept.push_back(blocks[i]);
  }
  Wanted wanted;
  wanted.kind = goal.kind;
  wanted.p = goal.p;
  wanted.confidence = campaign.inputs.plan().confidence;
  wanted.half_width = goal.half;
  if (goal.relative) {
    const RunsEstimate rough = RunsNeeded({goal.kind, goal.p, 0.0, wanted.confidence}, there, kept);
    wanted.half_width =
        rough.history.empty() ? goal.half : goal.half * std::abs(rough.history.back().value);
  }
  return RunsNeeded(wanted, there, kept);
}

}  // namespace

Goal ParseGoal(const std::string& text, const data::Campaign& plan, const std::string& where) {
  Goal goal;
  if (!ParseWords(text, &goal)) {
    throw Error(fmt::format("'{}' is no goal", text), where,
                "write \"P(latched) +- 0.002\", \"mean(peak) +- 1%\" or \"quantile(peak, 0.99) "
                "+- 20\"");
  }
  std::vector<std::string> names;
  for (const data::CampaignResponse& r : plan.responses) {
    names.push_back(r.name);
    if (r.name != goal.response) continue;
    if (r.yes_no != (goal.kind == AnswerKind::kProbability)) {
      throw Error(fmt::format("'{}' is {}", r.name, r.yes_no ? "yes or no" : "a number"), where,
                  r.yes_no ? "ask for P(" + r.name + ")" : "ask for its mean or a quantile");
    }
    return goal;
  }
  const std::string near = NearestName(goal.response, names);
  throw Error(fmt::format("there is no response '{}'", goal.response), where,
              near.empty() ? "the plan has " + JoinWords(names) : "did you mean '" + near + "'?");
}

EngineReport GrowUntil(OpenCampaign* campaign, const RunMissing& run) {
  const data::Campaign& plan = campaign->inputs.plan();
  const Goal goal = ParseGoal(plan.design.until, plan, plan.path + ":campaign.until");
  std::size_t response = 0;
  while (plan.responses[response].name != goal.response) ++response;
  EngineReport total;
  for (;;) {
    const std::uint64_t runs = campaign->inputs.runs();
    const EngineReport one = run(*campaign);
    total.parts += one.parts;
    total.runs += one.runs;
    total.run_seconds += one.run_seconds;
    total.crashed += one.crashed;
    const RunsEstimate now = Look(*campaign, goal, response);
    const std::uint64_t most = campaign->inputs.plan().design.most;
    if (now.met || runs >= most) return total;
    const auto n = static_cast<double>(runs);
    const double wanted = std::isfinite(now.runs) ? now.runs : kMostGrowth * n;
    const double next = std::ceil(std::clamp(wanted, kLeastGrowth * n, kMostGrowth * n));
    campaign->Extend(std::min(most, static_cast<std::uint64_t>(next)));
  }
}

}  // namespace unfurl::campaign
