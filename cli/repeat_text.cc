#include "cli/repeat_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/count.h"
#include "base/number.h"
#include "base/table.h"
#include "cli/fit_text.h"

namespace unfurl::cli {

using nlohmann::ordered_json;

namespace {

using RepeatTextRepeat = data::FitRecord::Repeat;

ordered_json RepeatTextFinite(double x) {
  return std::isfinite(x) ? ordered_json(x) : ordered_json(nullptr);
}

std::string Text(double x, int digits = 5) {
  return std::isfinite(x) ? IntervalEnd(x, digits) : "-";
}

std::string ValuesOverTrials(const data::FitRecord& record) {
  std::vector<std::vector<std::string>> rows = {{"parameter", "mean", "error", "95% low",
                                                 "95% high", "scatter", "95% low", "95% high",
                                                 "next low", "next high", "unit", "verdict"}};
  for (std::size_t j = 0; j < record.parameters.size(); ++j) {
    const auto& p = record.parameters[j];
    const RepeatTextRepeat::Parameter& q = record.repeat.parameters[j];
    const auto scatter = [&](double s) {
      if (!q.scatters) return std::string("-");
      return q.log ? fmt::format("{:.2g}%", 100.0 * s) : Number(s, 2);
    };
    const int mean = IntervalDigits(p.low95, p.high95);
    const int next = IntervalDigits(q.next_low95, q.next_high95);
    rows.push_back({p.name, IntervalEnd(p.value, std::max(mean, 6)), Number(p.sigma, 2),
                    Text(p.low95, mean), Text(p.high95, mean), scatter(q.scatter),
                    scatter(q.scatter_low95), scatter(q.scatter_high95), Text(q.next_low95, next),
                    Text(q.next_high95, next), p.unit == "1" ? "" : p.unit, p.verdict});
  }
  return AlignedTable(rows);
}

std::string ValuesByTrial(const data::FitRecord& record) {
  const RepeatTextRepeat& r = record.repeat;
  std::vector<std::vector<std::string>> rows = {{"trial"}};
  for (const auto& p : record.parameters) {
    rows[0].insert(rows[0].end(), {p.name, "by all", "p"});
  }
  for (std::size_t i = 0; i < r.trials.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    rows.push_back({r.trials[i]});
    for (std::size_t j = 0; j < record.parameters.size(); ++j) {
      const auto row = static_cast<Eigen::Index>(j);
      const double p = r.left_out_p(row, k);
      rows.back().insert(rows.back().end(), {Text(r.estimate(row, k)), Text(r.effect(row, k)),
                                             std::isfinite(p) ? Number(p, 2) : "-"});
    }
  }
  return AlignedTable(rows);
}

}  // namespace

std::string RepeatText(const data::FitRecord& record, double seconds) {
  std::string text = record.verdict + "\n";
  for (const std::string& reason : record.reasons) text += "  " + reason + "\n";
  if (!record.repeat.empty()) {
    text += ValuesOverTrials(record) +
            "each trial by itself, with what the others say, and its probability by them:\n" +
            ValuesByTrial(record);
  }
  std::size_t failed = 0;
  for (const auto& e : record.evaluations) failed += e.failed ? 1 : 0;
  return text + fmt::format("{} of the model, {} failed, in {:.1f} s\n",
                            Counted(record.evaluations.size(), "evaluation"), failed, seconds);
}

ordered_json RepeatJson(const data::FitRecord& record, const std::string& output, double seconds) {
  ordered_json json = FitJson(record, output, seconds);
  const RepeatTextRepeat& r = record.repeat;
  if (r.empty()) return json;
  ordered_json& out = json["repeat"];
  out["alike_p"] = r.alike_p;
  for (std::size_t j = 0; j < r.parameters.size(); ++j) {
    const RepeatTextRepeat::Parameter& q = r.parameters[j];
    const auto row = static_cast<Eigen::Index>(j);
    ordered_json one = {{"name", record.parameters[j].name},
                        {"scatters", q.scatters},
                        {"logarithm", q.log},
                        {"mean", RepeatTextFinite(record.parameters[j].value)},
                        {"mean_low95", RepeatTextFinite(record.parameters[j].low95)},
                        {"mean_high95", RepeatTextFinite(record.parameters[j].high95)},
                        {"scatter", q.scatter},
                        {"scatter_low95", q.scatter_low95},
                        {"scatter_high95", q.scatter_high95},
                        {"visible", q.visible},
                        {"next_low95", q.next_low95},
                        {"next_high95", q.next_high95},
                        {"alike_p", q.alike_p}};
    for (std::size_t i = 0; i < r.trials.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      one["trials"].push_back({{"trial", r.trials[i]},
                               {"value", r.estimate(row, k)},
                               {"low95", r.low95(row, k)},
                               {"high95", r.high95(row, k)},
                               {"effect", RepeatTextFinite(r.effect(row, k))},
                               {"effect_low95", RepeatTextFinite(r.effect_low95(row, k))},
                               {"effect_high95", RepeatTextFinite(r.effect_high95(row, k))},
                               {"p", RepeatTextFinite(r.left_out_p(row, k))},
                               {"log_density", RepeatTextFinite(r.left_out_log_density(row, k))}});
    }
    out["parameters"].push_back(std::move(one));
  }
  for (std::size_t i = 0; i < r.trials.size(); ++i) {
    out["unlike"].push_back({{"trial", r.trials[i]}, {"p", r.unlike_p[i]}});
  }
  return json;
}

}  // namespace unfurl::cli
