#include "cli/fit_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "report/number.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

using report::Level;

Level LevelOf(correlate::Verdict verdict) {
  switch (verdict) {
    case correlate::Verdict::kDetermined:
      return Level::kGood;
    case correlate::Verdict::kMeshLimited:
      return Level::kCare;
    default:
      return Level::kBad;
  }
}

void AddParameters(const FitPageInput& in, report::Page* page) {
  std::vector<report::Figure> figures;
  report::Table values, parts;
  values.title = "What was fitted";
  values.header = {"parameter", "start", "value",   "standard error",
                   "%",         "unit",  "verdict", "keys of the scene"};
  values.text_columns = {0, 5, 6, 7};
  parts.title = "What the standard errors are made of";
  parts.note =
      "Of the data: the samples' own errors and the calibration's, widened for what the residuals' "
      "correlation shows. Of the model: its mesh and tolerance, judged by a finer mesh at the "
      "estimate; the last column says where the value would go with no mesh error at all.";
  parts.header = {"parameter", "were the residuals white", "of the data", "of the model",
                  "all",       "the finer mesh's shift",   "roughness"};
  for (std::size_t j = 0; j < in.record.parameters.size(); ++j) {
    const auto& p = in.record.parameters[j];
    const auto& e = in.result.parameters[j];
    figures.push_back({p.name, report::NumberWithError(p.value, p.sigma) + " " + p.unit, p.verdict,
                       LevelOf(e.verdict)});
    const std::string keys =
        p.keys.front() + (p.keys.size() > 1 ? fmt::format(" and {} more", p.keys.size() - 1) : "");
    values.rows.push_back({p.name, fmt::format("{:.4g}", p.start), fmt::format("{:.6g}", p.value),
                           fmt::format("{:.2g}", p.sigma),
                           fmt::format("{:.2f}", 100.0 * p.sigma / std::abs(p.value)), p.unit,
                           p.verdict, keys});
    parts.rows.push_back({p.name, fmt::format("{:.2g}", p.sigma_white),
                          fmt::format("{:.2g}", p.sigma_data), fmt::format("{:.2g}", p.sigma_model),
                          fmt::format("{:.2g}", p.sigma), fmt::format("{:+.2g}", p.model_shift),
                          fmt::format("{:.2g}", p.kink)});
  }
  page->AddFigures(figures);
  page->AddTable(values);
  page->AddTable(parts);
}

void AddModelError(const FitPageInput& in, report::Page* page) {
  if (in.record.model_error.cols() == 0) return;
  page->AddSection(
      "The model's own error",
      fmt::format("What a finer mesh moves the marks by at the estimate: {:.3g} mm RMS, {:.2g} of "
                  "their sigma. It is counted in the standard errors as an error common to all "
                  "samples, once as a whole and once in pieces by mark and time.",
                  1e3 * in.result.model_error_rms, in.result.model_error_sigmas));
  report::Chart chart;
  chart.title = "Distance to the finer mesh";
  chart.y = {"distance", "mm", false};
  for (std::size_t m = 0; m < in.record.marks.size(); ++m) {
    report::Series s;
    s.name = in.record.marks[m];
    for (std::size_t i = 0; i < in.record.t.size(); ++i) {
      if (in.record.mark[i] != static_cast<std::int32_t>(m)) continue;
      s.x.push_back(in.record.t[i]);
      s.y.push_back(1e3 * in.record.model_error.col(static_cast<Eigen::Index>(i)).norm());
    }
    chart.series.push_back(std::move(s));
  }
  page->AddTimeSeries(std::move(chart));
}

void AddSearch(const FitPageInput& in, report::Page* page) {
  page->AddSection("The way to the answer",
                   fmt::format("{} evaluations of the model; every one is in the file.",
                               in.record.evaluations.size()));
  report::Table stages;
  stages.title = "Stages";
  stages.header = {"until", "samples", "iterations", "half the sum of squares"};
  for (const auto& p : in.record.parameters) stages.header.push_back(p.name + " [" + p.unit + "]");
  for (const correlate::StageResult& s : in.result.stages) {
    std::vector<std::string> row = {std::isfinite(s.end) ? fmt::format("{:g} s", s.end) : "the end",
                                    std::to_string(s.samples), std::to_string(s.iterations),
                                    fmt::format("{:.5g}", s.cost)};
    for (double value : s.theta) row.push_back(fmt::format("{:.6g}", value));
    row.resize(stages.header.size(), "-");
    stages.rows.push_back(std::move(row));
  }
  page->AddTable(stages);
}

}  // namespace

void WriteFitPage(const std::string& path, const FitPageInput& in) {
  report::Page page("Fit", in.record.study);
  Level level = in.result.Usable() ? Level::kGood : Level::kBad;
  for (const auto& p : in.result.parameters) {
    if (in.result.Usable()) level = std::max(level, LevelOf(p.verdict));
  }
  page.AddWords(level, in.record.verdict, in.record.reasons);
  if (!in.result.prediction.marks.empty()) {
    AddParameters(in, &page);
    if (!in.comparison.errors.empty()) AddComparisonPanels(in.comparison, &page);
    AddModelError(in, &page);
    AddSearch(in, &page);
  }
  page.AddOrigin("program", in.provenance.program);
  page.AddOrigin("command", in.provenance.command);
  for (const data::InputFile& input : in.provenance.inputs) {
    page.AddOrigin(input.path, "sha256 " + input.sha256);
  }
  page.Write(path);
}

}  // namespace unfurl::cli
