#include "cli/cost_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "report/page.h"

namespace unfurl::cli {

std::vector<std::vector<std::string>> CostRows(const correlate::CostStudy& study) {
  std::vector<std::vector<std::string>> rows = {
      {"method", "rtol", "segments", "seconds", "RMS error [%]", "largest [%]", "best"}};
  for (const correlate::CostPoint& p : study.points) {
    const std::string mesh = p.setting.mesh > 0 ? fmt::format("{}", p.setting.mesh) : "-";
    std::vector<std::string> row = {
        p.setting.method, fmt::format("{:g}", p.setting.tolerance), mesh, "-", "-", "-", p.message};
    if (p.usable) {
      row[3] = fmt::format("{:.4g}", p.seconds);
      row[4] = fmt::format("{:.3g}", 100.0 * p.rms);
      row[5] = fmt::format("{:.3g}", 100.0 * p.largest);
      row[6] = p.on_front ? "yes" : "";
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

void WriteCostPage(const std::string& path, const std::string& scene,
                   const correlate::CostStudy& study, const data::Provenance& provenance) {
  report::Page page("What accuracy costs", scene);
  const std::vector<std::string> advice = correlate::CostAdvice(study);
  std::vector<std::string> details(advice.begin() + 1, advice.end());
  details.push_back(
      fmt::format("Errors are distances of the marks from the finest run ({}), over "
                  "the range of each mark's motion; the worst mark counts.",
                  study.reference.Name()));
  if (study.floor >= 0.0) {
    details.push_back(
        fmt::format("A second finest run ({}) differs from it by {:.2e}: errors below "
                    "a few of that are not resolved.",
                    study.second.Name(), study.floor));
  }
  page.AddWords(report::Level::kGood, "For an error of " + advice.front(), details);
  report::Chart chart;
  chart.title = "Error against time";
  chart.note = "Down and left is better. One curve per method and mesh, from loose to tight.";
  chart.x = {"computing", "s", true};
  chart.y = {"RMS error", "%", true};
  std::map<std::string, std::vector<std::pair<double, double>>> curves;
  for (const correlate::CostPoint& p : study.points) {
    if (!p.usable) continue;
    std::string name = p.setting.method;
    if (p.setting.mesh > 0) name += fmt::format(", {} segments", p.setting.mesh);
    curves[name].push_back({p.seconds, 100.0 * p.rms});
  }
  for (auto& [name, points] : curves) {
    std::sort(points.begin(), points.end());
    report::Series series;
    series.name = name;
    for (const auto& [seconds, error] : points) {
      if (!series.x.empty() && seconds <= series.x.back()) continue;
      series.x.push_back(seconds);
      series.y.push_back(error);
    }
    chart.series.push_back(std::move(series));
  }
  page.AddChart(chart);
  report::Table table;
  table.title = "Every setting";
  const auto rows = CostRows(study);
  table.header = rows[0];
  table.rows.assign(rows.begin() + 1, rows.end());
  table.text_columns = {0, 6};
  page.AddTable(table);
  page.AddOrigin(provenance);
  page.Write(path);
}

}  // namespace unfurl::cli
