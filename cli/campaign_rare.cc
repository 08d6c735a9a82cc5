#include "cli/campaign_rare.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "base/number.h"
#include "base/table.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

std::vector<std::vector<std::string>> LevelRows(const campaign::RareResult& r) {
  const std::string unit = r.unit.empty() ? "" : " [" + r.unit + "]";
  std::vector<std::vector<std::string>> rows = {
      {"level", r.response + " below" + unit, "given the level before", "accepted", "runs"}};
  for (std::size_t l = 0; l < r.levels.size(); ++l) {
    const campaign::SubsetLevel& level = r.levels[l];
    rows.push_back({fmt::format("{}", l + 1), Number(level.threshold), Number(level.probability, 3),
                    fmt::format("{:.0f}%", 100.0 * level.acceptance),
                    fmt::format("{}", level.runs)});
  }
  return rows;
}

std::string Headline(const campaign::RareResult& r) {
  return fmt::format("P({} < 0) = {:.3g} ({:.2g} to {:.2g}), by {} of {} runs", r.response,
                     r.probability, r.interval.low, r.interval.high, r.method, r.runs);
}

}  // namespace

std::string RareText(const campaign::RareResult& r) {
  std::string out = Headline(r) + "\n" + AlignedTable(LevelRows(r));
  for (const std::string& note : r.notes) out += "note: " + note + "\n";
  return out;
}

void WriteRarePage(const std::string& path, const campaign::RareResult& r,
                   data::Provenance provenance, const std::string& record_path) {
  report::Page page("Rare failure", r.response);
  const report::Level level = !r.usable         ? report::Level::kBad
                              : r.notes.empty() ? report::Level::kGood
                                                : report::Level::kCare;
  page.AddWords(level, r.usable ? Headline(r) : r.message, r.notes);
  report::Chart chart;
  chart.title = "Levels";
  chart.note = "Probability that the margin is below each level's bound.";
  chart.x = {r.response, r.unit};
  chart.y = {"P", "1", true};
  report::Series series;
  series.name = "P(" + r.response + " < bound)";
  double probability = 1.0;
  std::vector<std::pair<double, double>> points;
  for (const campaign::SubsetLevel& l : r.levels) {
    probability *= l.probability;
    points.emplace_back(l.threshold, probability);
  }
  std::reverse(points.begin(), points.end());  // bounds fall from level to level
  for (const auto& [bound, p] : points) {
    series.x.push_back(bound);
    series.y.push_back(p);
  }
  if (series.x.size() > 1) {
    chart.series.push_back(std::move(series));
    page.AddChart(chart);
  }
  const std::vector<std::vector<std::string>> rows = LevelRows(r);
  report::Table table;
  table.title = "Levels of the subset simulation";
  table.header = rows[0];
  table.rows.assign(rows.begin() + 1, rows.end());
  page.AddTable(table);
  provenance.AddInput(record_path);
  page.AddOrigin(provenance);
  page.Write(path);
}

}  // namespace unfurl::cli
