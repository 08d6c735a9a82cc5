#include "cli/certificate_panel.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "sim/record/certificate.h"

namespace unfurl::cli {

namespace {

using Line = sim::Certificate::Line;

// Of all that the quantity does, or of the load.
double PartOf(const Line& line) {
  return line.range > 0.0 ? (line.time + line.mesh) / line.range : 0.0;
}

std::vector<Line> WorstFirst(std::vector<Line> lines) {
  std::stable_sort(lines.begin(), lines.end(),
                   [](const Line& a, const Line& b) { return PartOf(a) > PartOf(b); });
  return lines;
}

void AddErrorTable(const std::vector<Line>& lines, const char* title, const char* note,
                   const char* whole, report::Page* page) {
  report::Table table;
  table.title = title;
  table.note = note;
  table.header = {"quantity",      "unit", whole,
                  "time stepping", "mesh", fmt::format("of its {} [%]", whole)};
  table.text_columns = {0, 1};
  for (const Line& line : lines) {
    table.rows.push_back({line.name, line.units, fmt::format("{:.4g}", line.range),
                          fmt::format("{:.2g}", line.time), fmt::format("{:.2g}", line.mesh),
                          fmt::format("{:.2g}", 100.0 * PartOf(line))});
  }
  if (!lines.empty()) page->AddTable(table);
}

void AddBand(const Line& worst, const RunColumns& run, report::Page* page) {
  report::Chart chart;
  chart.title = worst.name + " with its band";
  chart.note = "The quantity whose error is the largest part of its range.";
  chart.y = {worst.name, worst.units, false};
  report::Series series;
  series.name = worst.name;
  series.x = run.Thin("t");
  series.y = run.Thin(worst.name);
  series.half_width = run.Thin("error_time." + worst.name);
  if (run.Has("error_mesh." + worst.name)) {
    const std::vector<double> more = run.Thin("error_mesh." + worst.name);
    for (std::size_t i = 0; i < more.size(); ++i) series.half_width[i] += more[i];
  }
  chart.series.push_back(std::move(series));
  page->AddTimeSeries(std::move(chart));
}

}  // namespace

std::string CertificateSentence(const sim::SummaryInput& input) {
  const sim::Certificate& certificate = *input.certificate;
  if (!certificate.problem().empty()) return {};
  const std::vector<Line> lines = WorstFirst(certificate.Lines());
  const std::vector<Line> loads = WorstFirst(certificate.LoadLines(input.report));
  std::string words;
  if (!lines.empty()) {
    words = fmt::format("{:.2g}% of all that a quantity does ({})", 100.0 * PartOf(lines[0]),
                        lines[0].name);
  }
  if (!loads.empty()) {
    words += fmt::format("{}{:.2g}% of a largest load ({})", words.empty() ? "" : " and ",
                         100.0 * PartOf(loads[0]), loads[0].name);
  }
  return words.empty() ? words : "The numerical error is at most " + words + ", see below.";
}

void AddCertificate(const sim::SummaryInput& input, const RunColumns& run, report::Page* page) {
  const sim::Certificate& certificate = *input.certificate;
  if (!certificate.problem().empty()) {
    page->AddSection("Numerical error", "Not known: " + certificate.problem() + ".");
    return;
  }
  const std::string& mesh = certificate.mesh();
  page->AddSection("Numerical error",
                   "Estimated by a run of a tenth of the tolerance" +
                       (mesh.empty() ? std::string(".") : " and one with " + mesh + "."));
  const std::vector<Line> lines = WorstFirst(certificate.Lines());
  AddErrorTable(lines, "Largest error of each quantity",
                "Range: from its least to its largest value. What the steps of time and the "
                "segments of the beams leave open, largest part first.",
                "range", page);
  AddErrorTable(WorstFirst(certificate.LoadLines(input.report)), "Error of each largest load",
                "Loads of an impact change with the mesh by more than motions do.", "value", page);
  if (!lines.empty() && run.Has("error_time." + lines[0].name)) AddBand(lines[0], run, page);
}

}  // namespace unfurl::cli
