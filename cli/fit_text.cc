#include "cli/fit_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/count.h"
#include "base/number.h"
#include "base/table.h"
#include "cli/verb.h"

namespace unfurl::cli {

using nlohmann::ordered_json;

std::string FitText(const data::FitRecord& record, double seconds) {
  std::string text = record.verdict + "\n";
  for (const std::string& reason : record.reasons) text += "  " + reason + "\n";
  std::size_t failed = 0;
  for (const auto& e : record.evaluations) failed += e.failed ? 1 : 0;
  const std::string cost =
      fmt::format("{} of the model, {} failed, in {:.1f} s\n",
                  Counted(record.evaluations.size(), "evaluation"), failed, seconds);
  if (record.nuisances.empty() && record.status != "converged") return text + cost;
  std::vector<std::vector<std::string>> rows = {{"parameter", "value", "error", "%", "of data",
                                                 "of model", "95% low", "95% high", "data's low",
                                                 "data's high", "unit", "verdict"}};
  for (const auto& p : record.parameters) {
    const int all = IntervalDigits(p.low95, p.high95);
    const int data = IntervalDigits(p.low95_data, p.high95_data);
    rows.push_back({p.name, IntervalEnd(p.value, std::max(all, 6)), Number(p.sigma, 2),
                    fmt::format("{:.2f}", 100.0 * p.sigma / std::abs(p.value)),
                    Number(p.sigma_data, 2), Number(p.sigma_model, 2), IntervalEnd(p.low95, all),
                    IntervalEnd(p.high95, all), IntervalEnd(p.low95_data, data),
                    IntervalEnd(p.high95_data, data), p.unit == "1" ? "" : p.unit, p.verdict});
  }
  text += AlignedTable(rows);
  for (const auto& n : record.nuisances) {
    if (n.name.starts_with("frame ") || n.name.starts_with("calibration ")) continue;
    text += fmt::format(
        "{}{} {}{}\n", n.name,
        record.trials.size() > 1 ? " of " + record.trials[static_cast<std::size_t>(n.trial)] : "",
        NumberWithError(n.value, n.sigma), UnitAfter(n.unit));
  }
  for (std::size_t i = 0; i < record.rungs.size(); ++i) {
    text += fmt::format("{}{}: {} run{}{}", i == 0 ? "ladder: " : "; ", record.rungs[i].name,
                        record.rungs[i].runs, record.rungs[i].runs == 1 ? "" : "s",
                        i + 1 == record.rungs.size() ? "\n" : "");
  }
  return text + cost;
}

namespace {

// NaN, as of the first look, is null.
ordered_json LadderJson(const data::FitRecord& record) {
  auto number = [](double x) { return std::isfinite(x) ? ordered_json(x) : ordered_json(nullptr); };
  ordered_json json;
  for (const auto& rung : record.rungs) {
    json["rungs"].push_back({{"name", rung.name}, {"runs", rung.runs}});
  }
  json["rounds"] = ordered_json::array();
  for (const auto& r : record.rounds) {
    json["rounds"].push_back({{"base", r.base},
                              {"theta", r.theta},
                              {"fine_cost", r.fine_cost},
                              {"step", number(r.step)},
                              {"contraction", number(r.contraction)},
                              {"counted", r.counted},
                              {"slope", r.slope}});
  }
  return json;
}

}  // namespace

ordered_json FitJson(const data::FitRecord& record, const std::string& output, double seconds) {
  ordered_json json = {{"fit", output},
                       {"status", record.status},
                       {"verdict", record.verdict},
                       {"reasons", record.reasons}};
  auto limit = [](double x) { return std::isfinite(x) ? ordered_json(x) : ordered_json(nullptr); };
  for (const auto& p : record.parameters) {
    json["parameters"].push_back({{"name", p.name},
                                  {"unit", p.unit},
                                  {"value", p.value},
                                  {"sigma", p.sigma},
                                  {"sigma_data", p.sigma_data},
                                  {"sigma_white", p.sigma_white},
                                  {"sigma_model", p.sigma_model},
                                  {"sigma_alone", limit(p.sigma_alone)},
                                  {"sigma_doubt", p.sigma_doubt},
                                  {"model_shift", p.model_shift},
                                  {"low95", limit(p.low95)},
                                  {"high95", limit(p.high95)},
                                  {"low95_data", limit(p.low95_data)},
                                  {"high95_data", limit(p.high95_data)},
                                  {"kink", p.kink},
                                  {"imitated", p.imitated},
                                  {"verdict", p.verdict},
                                  {"with", p.with},
                                  {"reason", p.reason}});
  }
  for (const auto& n : record.nuisances) {
    if (n.name.rfind("calibration", 0) == 0) continue;
    json["nuisances"].push_back({{"name", n.name},
                                 {"trial", record.trials[static_cast<std::size_t>(n.trial)]},
                                 {"value", n.value},
                                 {"sigma", n.sigma}});
  }
  for (const auto& g : record.gross) {
    json["gross"].push_back({{"trial", record.trials[static_cast<std::size_t>(g.trial)]},
                             {"mark", record.marks[static_cast<std::size_t>(g.mark)]},
                             {"t", g.t},
                             {"sigmas", g.sigmas}});
  }
  for (const auto& c : record.channels) {
    for (std::size_t i = 0; i < c.gross_t.size(); ++i) {
      json["gross"].push_back({{"trial", record.trials[static_cast<std::size_t>(c.trial)]},
                               {"channel", c.name},
                               {"t", c.gross_t[i]},
                               {"sigmas", c.gross_sigmas[i]}});
    }
  }
  for (const auto& s : record.starts) {
    json["starts"].push_back({{"from", s.from}, {"to", s.to}, {"cost", s.cost}});
  }
  if (!record.rungs.empty()) json["ladder"] = LadderJson(record);
  for (const auto& [name, value] : record.checks) json["checks"][name] = value;
  json["evaluations"] = record.evaluations.size();
  std::size_t failed = 0;
  for (const auto& e : record.evaluations) failed += e.failed ? 1 : 0;
  json["failed"] = failed;
  json["seconds"] = seconds;
  return json;
}

}  // namespace unfurl::cli
