#include "cli/cost_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/count.h"
#include "base/table.h"
#include "base/text.h"
#include "report/page.h"

namespace unfurl::cli {
namespace {

using study::CostError;
using study::CostLine;
using study::CostPercent;
using study::CostPoint;
using study::SceneCost;
using CostPageTextTable = std::vector<std::vector<std::string>>;

constexpr char kLinesNote[] =
    "Scale: what errors are parts of: the range of motion, the magnitude of a number. Known to: "
    "how "
    "well the reference is known, of that. Then the cheapest setting, by its number, for a "
    "root-mean-square error of so much, that of the reference added.";
constexpr char kSettingsNote[] =
    "CPU: the thread's own, the median of its runs, with its standard error. Errors are of the "
    "worst line, '<' where the reference is not known well enough to say more. Best: no other is "
    "both faster and more accurate.";

std::string CpuText(const CostPoint& p) {
  return p.scatter > 0.0 ? fmt::format("{:.3g} +- {:.1g}", p.seconds, p.scatter)
                         : fmt::format("{:.3g}", p.seconds);
}

std::string ErrorText(const CostError& e) {
  return (e.bound && std::isfinite(e.rms) ? "< " : "") + CostPercent(e.rms);
}

CostPageTextTable LineRows(const SceneCost& cost) {
  CostPageTextTable rows = {{"line", "scale", "known to"}};
  for (const double target : study::kCostTargets) rows[0].push_back(CostPercent(target));
  for (std::size_t l = 0; l < cost.lines.size(); ++l) {
    const CostLine& line = cost.lines[l];
    std::vector<std::string> row = {
        line.quantity.name,
        fmt::format("{:.4g}{}", line.scale,
                    line.quantity.unit == "1" ? "" : " " + line.quantity.unit),
        line.settled ? CostPercent(line.reference_error) : "not known"};
    for (const double target : study::kCostTargets) {
      const CostPoint* best =
          line.settled ? study::Cheapest(cost, target, static_cast<int>(l)) : nullptr;
      row.push_back(best == nullptr ? "-"
                                    : fmt::format("#{}, {:.3g} s", best - cost.points.data() + 1,
                                                  best->seconds));
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

// Those that the lines name.
std::vector<bool> Named(const SceneCost& cost) {
  std::vector<bool> named(cost.points.size(), false);
  for (std::size_t l = 0; l < cost.lines.size(); ++l) {
    for (const double target : study::kCostTargets) {
      if (!cost.lines[l].settled) continue;
      const CostPoint* best = study::Cheapest(cost, target, static_cast<int>(l));
      if (best != nullptr) named[static_cast<std::size_t>(best - cost.points.data())] = true;
    }
  }
  return named;
}

// `all`: else what the lines name.
CostPageTextTable SettingRows(const SceneCost& cost, bool all) {
  const std::vector<bool> named = Named(cost);
  CostPageTextTable rows = {
      {"beams", "method", "rtol", "#", "CPU [s]", "error", "largest", "in", "best"}};
  for (const CostPoint& p : cost.points) {
    const auto at = static_cast<std::size_t>(&p - cost.points.data());
    if (!all && !named[at]) continue;
    std::vector<std::string> row = {p.setting.beams.empty() ? "-" : p.setting.beams,
                                    p.setting.method, fmt::format("{:g}", p.setting.tolerance),
                                    fmt::format("{}", at + 1)};
    if (!p.usable || p.worst < 0) {
      row.insert(row.end(), {p.seconds > 0.0 ? CpuText(p) : "-", "-", "-",
                             p.usable ? "" : p.message, "no result"});
    } else {
      const auto worst = static_cast<std::size_t>(p.worst);
      row.insert(row.end(), {CpuText(p), ErrorText(p.errors[worst]), CostPercent(p.largest),
                             cost.lines[worst].quantity.name, p.on_front ? "yes" : ""});
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

// "#3: --set ..", of those that the lines name.
std::vector<std::string> SetLines(const SceneCost& cost) {
  const std::vector<bool> named = Named(cost);
  std::vector<std::string> out;
  for (std::size_t k = 0; k < named.size(); ++k) {
    if (!named[k]) continue;
    out.push_back(fmt::format("#{}: {}", k + 1, cost.points[k].setting.SetText()));
  }
  return out;
}

report::Table PageTable(const std::string& title, const std::string& note,
                        const CostPageTextTable& rows, std::vector<int> text_columns) {
  report::Table table;
  table.title = title;
  table.note = note;
  table.header = rows[0];
  table.rows.assign(rows.begin() + 1, rows.end());
  table.text_columns = std::move(text_columns);
  return table;
}

// Values by rising seconds as a series; of settings that took as long the first.
report::Series CostSeries(const std::string& name, std::vector<std::pair<double, double>> points,
                          report::Style style) {
  std::sort(points.begin(), points.end());
  report::Series series;
  series.name = name;
  series.style = style;
  for (const auto& [seconds, error] : points) {
    if (!series.x.empty() && seconds <= series.x.back()) continue;
    series.x.push_back(seconds);
    series.y.push_back(error);
  }
  return series;
}

// Those that none beats in both, by rising seconds.
std::vector<std::pair<double, double>> Front(std::vector<std::pair<double, double>> points) {
  std::sort(points.begin(), points.end());
  std::vector<std::pair<double, double>> out;
  for (const auto& point : points) {
    if (out.empty() || point.second < out.back().second) out.push_back(point);
  }
  return out;
}

// Error against CPU of one line: a dot for each setting, by method, and what is best of all.
void AddLineChart(report::Page* page, const SceneCost& cost, std::size_t l) {
  report::Chart chart;
  chart.title = "Error of " + cost.lines[l].quantity.name + " against CPU time";
  chart.note =
      "Each setting is a dot; left and below is better. The line joins those that no other beats "
      "in both; the dashes: how well the reference is known.";
  chart.x = {"CPU time", "s", true};
  chart.y = {"RMS error, of its scale", "%", true};
  std::map<std::string, std::vector<std::pair<double, double>>> dots;
  std::vector<std::pair<double, double>> all;
  for (const CostPoint& p : cost.points) {
    if (!p.usable || !std::isfinite(p.errors[l].rms) || p.errors[l].rms <= 0.0) continue;
    dots[p.setting.method].push_back({p.seconds, 100.0 * p.errors[l].rms});
    all.push_back(dots[p.setting.method].back());
  }
  if (all.empty()) return;
  for (auto& [name, points] : dots) {
    chart.series.push_back(CostSeries(name, std::move(points), report::Style::kDots));
  }
  chart.series.push_back(CostSeries("the best", Front(all), report::Style::kLine));
  chart.series.back().color = 6;
  const auto [first, last] = std::minmax_element(all.begin(), all.end());
  if (last->first > first->first && cost.lines[l].reference_error > 0.0) {
    const double known = 100.0 * cost.lines[l].reference_error;
    chart.series.push_back(
        {"reference", {first->first, last->first}, {known, known}, {}, report::Style::kDashes, 7});
  }
  page->AddChart(chart);
}

}  // namespace

std::string CostText(const std::string& path, const std::string& name, const SceneCost& cost) {
  std::string text =
      fmt::format("{}: {:g} s of \"{}\", {} in {:.3g} s of CPU\n", path, cost.duration, name,
                  Counted(cost.points.size(), "setting"), cost.seconds);
  for (const std::string& line : study::CostAdvice(cost)) text += "  " + line + "\n";
  text += AlignedTable(LineRows(cost));
  text += fmt::format("({})\n", kLinesNote);
  for (const std::string& line : SetLines(cost)) text += "  " + line + "\n";
  constexpr std::size_t kMostRows = 24;  // of a table that a terminal shows whole
  const bool all = cost.points.size() <= kMostRows;
  text += AlignedTable(SettingRows(cost, all));
  text += fmt::format("({}{})\n", kSettingsNote, all ? "" : " All settings: --report, --json.");
  text += "reference: " + cost.reference + "\n";
  for (const std::string& why : cost.refused) text += "not run: " + why + "\n";
  if (!cost.absent.empty()) text += "not judged: " + JoinWords(cost.absent) + "\n";
  if (cost.left_out > 0) {
    text += fmt::format("{} settings were left out for lack of time (--within)\n", cost.left_out);
  }
  return text;
}

void WriteCostPage(const std::string& path, const std::string& scene, const SceneCost& cost,
                   const data::Provenance& provenance) {
  report::Page page("What accuracy costs", scene);
  const std::vector<study::CostCounsel> advice = study::CostCounsels(cost);
  std::vector<std::string> more;
  // What sets the first follows it, unless the next says the same.
  for (std::size_t k = 0; k < advice.size(); ++k) {
    if (k > 0) more.push_back(advice[k].words);
    const bool last = k + 1 == advice.size() || advice[k + 1].set != advice[k].set;
    if (last && !advice[k].set.empty()) more.push_back(advice[k].set);
  }
  page.AddWords(cost.Usable() ? report::Level::kGood : report::Level::kBad, advice.front().words,
                more);
  page.AddTable(PageTable("Line by line", kLinesNote, LineRows(cost), {0, 1, 3, 4, 5}));
  page.AddWords(report::Level::kNeutral, "As overrides", SetLines(cost));
  for (std::size_t l = 0; l < cost.lines.size(); ++l) {
    if (cost.lines[l].settled) AddLineChart(&page, cost, l);
  }
  page.AddTable(PageTable("Every setting", kSettingsNote, SettingRows(cost, true), {0, 1, 7, 8}));
  std::vector<std::string> left_out = cost.refused;
  left_out.insert(left_out.end(), cost.absent.begin(), cost.absent.end());
  left_out.insert(left_out.begin(), "Compared with " + cost.reference);
  page.AddWords(report::Level::kNeutral, "The reference", left_out);
  page.AddOrigin(provenance);
  page.Write(path);
}

}  // namespace unfurl::cli
