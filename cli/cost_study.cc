#include "cli/cost_study.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/progress.h"
#include "base/table.h"
#include "base/text.h"
#include "data/study.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;
using CostStudyTextTable = std::vector<std::vector<std::string>>;

CostStudyTextTable CostStudyRows(const study::StudyCost& cost) {
  CostStudyTextTable rows = {{"what", "setting", "CPU [s]"}};
  for (std::size_t j = 0; j < cost.parameters.size(); ++j) {
    rows[0].push_back(fmt::format("{} +- [{}]", cost.parameters[j], cost.units[j]));
    rows[0].push_back("shift");
  }
  rows[0].push_back("finer mesh");
  rows[0].push_back("best");
  for (const study::StudyCostPoint& p : cost.points) {
    std::vector<std::string> row = {p.setting.kind, p.setting.name,
                                    p.seconds > 0.0 ? fmt::format("{:.3g}", p.seconds) : "-"};
    for (std::size_t j = 0; j < cost.parameters.size(); ++j) {
      const bool there = p.usable && j < p.values.size();
      const double half = there ? p.values[j].Half() : 0.0;
      row.push_back(!there ? "-" : std::isfinite(half) ? fmt::format("{:.3g}", half) : "open");
      row.push_back(there ? fmt::format("{:+.2f}", p.values[j].shift) : "-");
    }
    row.push_back(!p.usable ? "-" : p.mesh_tested ? "tested" : "not tested");
    row.push_back(!p.usable ? "not usable" : !p.agrees ? "disagrees" : p.on_front ? "yes" : "");
    rows.push_back(std::move(row));
  }
  return rows;
}

ordered_json Json(const std::string& study, const study::StudyCost& cost) {
  ordered_json out = {{"study", study},
                      {"advice", study::CostAdvice(cost)},
                      {"left_out", cost.left_out},
                      {"settings", ordered_json::array()}};
  for (const study::StudyCostPoint& p : cost.points) {
    ordered_json one = {{"kind", p.setting.kind},
                        {"name", p.setting.name},
                        {"set", p.setting.set},
                        {"usable", p.usable},
                        {"seconds", p.seconds}};
    if (!p.usable) {
      one["message"] = p.message;
      out["settings"].push_back(std::move(one));
      continue;
    }
    one["mesh_tested"] = p.mesh_tested;
    one["agrees"] = p.agrees;
    one["on_front"] = p.on_front;
    for (std::size_t j = 0; j < cost.parameters.size(); ++j) {
      const study::StudyCostValue& v = p.values[j];
      ordered_json value = {{"value", v.value}, {"shift", v.shift}};
      value["half_width"] = std::isfinite(v.Half()) ? ordered_json(v.Half()) : ordered_json();
      one["parameters"][cost.parameters[j]] = std::move(value);
    }
    out["settings"].push_back(std::move(one));
  }
  return out;
}

// Half width over that of the study as it is, against CPU: a dot for each setting, by what varies.
void AddChart(report::Page* page, const study::StudyCost& cost, std::size_t j) {
  report::Chart chart;
  chart.title = "Width of the interval of " + cost.parameters[j] + " against CPU time";
  chart.note =
      "Half of the 95% interval. Down and left is better; settings that have not looked at "
      "a finer mesh, or disagree, are not shown.";
  chart.x = {"computing", "s", true};
  chart.y = {cost.parameters[j] + ", half interval", cost.units[j], true};
  std::vector<std::string> kinds = study::StudyCostKinds();
  kinds.insert(kinds.begin(), "");
  for (const std::string& kind : kinds) {
    std::vector<std::pair<double, double>> dots;
    for (const study::StudyCostPoint& p : cost.points) {
      if (p.setting.kind != kind || !p.usable || !p.agrees) continue;
      if (cost.points[0].mesh_tested && !p.mesh_tested) continue;
      if (std::isfinite(p.values[j].Half())) dots.emplace_back(p.seconds, p.values[j].Half());
    }
    std::sort(dots.begin(), dots.end());
    report::Series series;
    series.name = kind.empty() ? "as it is" : kind;
    series.style = report::Style::kDots;
    for (const auto& [seconds, half] : dots) {
      series.x.push_back(seconds);
      series.y.push_back(half);
    }
    if (!dots.empty()) chart.series.push_back(std::move(series));
  }
  page->AddChart(chart);
}

void WritePage(const Common& common, const CostStudyArguments& a, const study::StudyCost& cost) {
  report::Page page("What narrow intervals cost", a.study);
  const std::vector<std::string> advice = study::CostAdvice(cost);
  page.AddWords(report::Level::kGood, "Intervals " + advice.front(),
                {advice.begin() + 1, advice.end()});
  for (std::size_t j = 0; j < cost.parameters.size(); ++j) AddChart(&page, cost, j);
  report::Table table;
  table.title = "Every setting";
  table.note = "Shift: of the value, in half intervals of the study as it is.";
  const CostStudyTextTable rows = CostStudyRows(cost);
  table.header = rows[0];
  table.rows.assign(rows.begin() + 1, rows.end());
  const int last = static_cast<int>(rows[0].size()) - 1;
  table.text_columns = {0, 1, last - 1, last};
  page.AddTable(table);
  data::Provenance provenance = StartProvenance(common);
  provenance.AddInput(a.study);
  page.AddOrigin(provenance);
  page.Write(a.report);
}

}  // namespace

double TimeOption(const std::string& text) {
  const std::size_t end = text.find_first_not_of("0123456789.");
  const std::string unit = end == std::string::npos ? "s" : text.substr(end);
  double value = 0.0;
  const double factor = unit == "s" ? 1.0 : unit == "min" ? 60.0 : unit == "h" ? 3600.0 : 0.0;
  if (!ParseDouble(text.substr(0, end), &value) || factor == 0.0 || !(value > 0.0)) {
    throw Error("'" + text + "' is no time", "--within", "write 60s, 5min or 1h, say");
  }
  return value * factor;
}

int RunCostStudy(const Common& common, const CostStudyArguments& a) {
  study::StudyCostOptions options = a.cost;
  if (!a.within.empty()) options.within = TimeOption(a.within);
  study::StudyCost cost;
  try {
    Progress progress("cost", !common.quiet);
    options.progress = [&](double part, const std::string& what) { progress.Update(part, what); };
    cost = study::CostOfStudy(a.study, a.sets, options);
  } catch (const Error& e) {
    throw AtOption(e, {{"StudyCostOptions.vary", "--vary"}});
  }
  if (!cost.Usable()) return FitNotUsable(a.study, cost.points.front().message);
  ordered_json json = Json(a.study, cost);
  std::string text = fmt::format("{}: the cheapest setting for intervals\n", a.study);
  for (const std::string& line : study::CostAdvice(cost)) text += "  " + line + "\n";
  text += AlignedTable(CostStudyRows(cost));
  text +=
      "(+-: half of the 95% interval of all parts; shift: of the value, in half intervals of the "
      "study as it is; best: none that is as well tested is both cheaper and narrower)\n";
  if (cost.left_out > 0) {
    text += fmt::format("{} settings were left out for lack of time (--within)\n", cost.left_out);
  }
  if (!a.report.empty()) {
    WritePage(common, a, cost);
    text += "page -> " + a.report + "\n";
    json["report"] = a.report;
  }
  Finish(common, json, text);
  return kExitGood;
}

}  // namespace unfurl::cli
