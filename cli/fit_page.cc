#include "cli/fit_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/count.h"
#include "base/length.h"
#include "base/number.h"
#include "base/text.h"
#include "cli/channels_panel.h"
#include "cli/comparison_panels.h"
#include "cli/ladder_panel.h"
#include "cli/motion_panel.h"
#include "cli/residuals_panel.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

using report::Level;

Level LevelOfFitPage(correlate::Verdict verdict) {
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
  report::Table values, parts, keys;
  values.title = "Estimates";
  values.header = {"parameter",           "value",  "standard error", "%", "95%, all parts",
                   "95%, the data alone", "verdict"};
  values.text_columns = {0, 6};
  values.note =
      "The interval of all parts is what can be said of the parameter: the data's and the model's "
      "own error together. The data alone: what they would say of it were the model without error.";
  keys.title = "Where they act";
  keys.header = {"parameter", "start", "keys"};
  keys.text_columns = {0, 2};
  parts.title = "Contributions to the standard errors";
  parts.note =
      "Of the data: the samples' own errors and the calibration's, widened for what the residuals' "
      "correlation shows. Of the model: its own error, judged by a better model at the estimate "
      "(the reasons above say by which); the shift says where the value would go without that "
      "error. Alone: what the data would give "
      "were all other parameters known. Roughness: by how much the differences of "
      "the marks to either side of the estimate disagree, |D+ - D-| / |D+ + D-|: 0 for a smooth "
      "model, 1 where impacts come and go within the step. Above 0.3 they are not averaged: the "
      "side that leads downhill moves the solver, and the flatter one sets the standard error.";
  parts.header = {"parameter", "assuming white residuals", "of the data", "of the model", "all",
                  "alone",     "the better model's shift", "roughness"};
  for (std::size_t j = 0; j < in.record.parameters.size(); ++j) {
    const auto& p = in.record.parameters[j];
    const auto& e = in.result.parameters[j];
    figures.push_back({p.name, NumberWithError(p.value, p.sigma) + UnitAfter(p.unit), p.verdict,
                       LevelOfFitPage(e.verdict)});
    const bool bare = p.unit.empty() || p.unit == "1";
    const std::string named = p.name + (bare ? "" : " [" + p.unit + "]");
    values.rows.push_back(
        {named, IntervalEnd(p.value, IntervalDigits(p.low95, p.high95, 6)), Number(p.sigma, 2),
         fmt::format("{:.2f}", 100.0 * p.sigma / std::abs(p.value)),
         IntervalText(p.low95, p.high95), IntervalText(p.low95_data, p.high95_data), p.verdict});
    keys.rows.push_back({named, fmt::format("{:.4g}", p.start), JoinWords(p.keys)});
    parts.rows.push_back({p.name, Number(p.sigma_white, 2), Number(p.sigma_data, 2),
                          Number(p.sigma_model, 2), Number(p.sigma, 2), Number(p.sigma_alone, 2),
                          fmt::format("{:+.2g}", p.model_shift), Number(p.kink, 2)});
  }
  page->AddFigures(figures);
  page->AddTable(values);
  page->AddTable(parts);
  page->AddTable(keys);
}

void AddModelError(const FitPageInput& in, report::Page* page) {
  if (in.record.model_error.cols() == 0) return;
  const correlate::ErrorCheck check = in.result.trials.front().error_check;
  const bool mesh = check != correlate::ErrorCheck::kTolerance;
  const bool ladder = check == correlate::ErrorCheck::kLadder;
  page->AddSection(
      "The model's own error",
      fmt::format("What {} moves the marks by at the estimate: {} RMS, {:.2g} of "
                  "their sigma. It is counted in the standard errors as an error common to all "
                  "samples, once as a whole and once in pieces by mark and time.",
                  ladder ? "what the finest rung still lacks (by its change from the rung below)"
                  : mesh ? "a finer model"
                         : "a tighter tolerance",
                  LengthText(in.result.trials.front().model_error_rms),
                  in.result.trials.front().model_error_sigmas));
  report::Chart chart;
  chart.title = ladder ? "What the finest rung lacks"
                : mesh ? "Distance to the finer model"
                       : "Distance to the tighter tolerance";
  chart.y = {"distance", "mm", false};
  for (std::size_t m = 0; m < in.record.marks.size(); ++m) {
    report::Series s;
    s.name = in.record.marks[m];
    for (std::size_t i = 0; i < in.record.t.size(); ++i) {
      if (in.record.mark[i] != static_cast<std::int32_t>(m) || in.record.trial[i] != 0) continue;
      s.x.push_back(in.record.t[i]);
      s.y.push_back(1e3 * in.record.model_error.col(static_cast<Eigen::Index>(i)).norm());
    }
    chart.series.push_back(std::move(s));
  }
  page->AddTimeSeries(std::move(chart));
}

// The interval of all parts over that of the data alone; none where either is open.
void AddIntervals(const data::FitRecord::Parameter& p, report::Page* page) {
  const double ends[] = {p.low95, p.high95, p.low95_data, p.high95_data};
  if (!std::all_of(std::begin(ends), std::end(ends), [](double x) { return std::isfinite(x); })) {
    return;
  }
  report::Chart chart;
  chart.title = p.name + ", 95% intervals";
  chart.x = {p.name, p.unit, false};
  chart.y.label = "interval";
  chart.y.names = {{1.0, "the data alone"}, {2.0, "all parts"}};
  chart.height_px = 150;
  report::Series all, data, value;
  all.name = "all parts";
  all.x = {p.low95, p.high95};
  all.y = {2.0, 2.0};
  data.name = "the data alone";
  data.x = {p.low95_data, p.high95_data};
  data.y = {1.0, 1.0};
  value.name = "value";
  value.style = report::Style::kDots;
  value.x = {p.value, p.value};
  value.y = {1.0, 2.0};
  chart.series = {all, data, value};
  page->AddChart(chart);
}

// Deviance against each parameter: how well it is known with all others free.
void AddProfiles(const FitPageInput& in, report::Page* page) {
  if (in.record.profiles.empty()) return;
  page->AddSection(
      "Profiles",
      "Each parameter is held at values to either side and everything else is fitted anew; the "
      "deviance is what that costs, divided by what correlation is left in the residuals, so that "
      "the 95% interval of the data ends where it crosses 3.84. A profile that stays below says "
      "that the data do not determine this parameter by itself. The parabola is what the standard "
      "error of the data alone would give. Below each: the 95% interval of all parts, with the "
      "model's own error in it, over that of the data alone.");
  for (std::size_t j = 0; j < in.record.parameters.size(); ++j) {
    const auto& p = in.record.parameters[j];
    report::Chart chart;
    chart.title = p.name;
    chart.x = {p.name, p.unit, false};
    chart.y = {"deviance", "1", false};
    report::Series found, parabola, level;
    found.name = "profile";
    found.style = report::Style::kDots;
    parabola.name = "parabola of the standard error";
    level.name = "3.84";
    level.style = report::Style::kDashes;
    for (const auto& point : in.record.profiles) {
      if (point.parameter != static_cast<std::int32_t>(j) || !point.settled) continue;
      found.x.push_back(point.theta[j]);
      found.y.push_back(point.deviance / p.dispersion);
    }
    if (found.x.size() < 2) continue;
    constexpr int kPoints = 81;        // of the drawn parabola: smooth at a page's width
    constexpr double kHighest = 12.0;  // of the parabola: three times what ends the interval
    const double low = found.x.front(), high = found.x.back();
    for (int i = 0; i < kPoints; ++i) {
      const double x = low + (high - low) * i / (kPoints - 1);
      const double z = p.sigma_data > 0.0 ? (x - p.value) / p.sigma_data : 0.0;
      parabola.x.push_back(x);
      parabola.y.push_back(std::min(z * z, kHighest));
    }
    level.x = {low, high};
    level.y.assign(2, correlate::kDeviance95);
    chart.series = {found, parabola, level};
    page->AddChart(chart);
    AddIntervals(p, page);
  }
}

// Where several starts ended, best first.
void AddWaterfall(const FitPageInput& in, report::Page* page) {
  if (in.record.starts.size() < 2) return;
  report::Chart chart;
  chart.title = "Starts, best end first";
  chart.note =
      "Half the sum of squares over the whole record to which each start led. A step that many "
      "share is a minimum found repeatedly; the lowest is the estimate.";
  chart.x = {"start", "1", false};
  chart.y = {"half the sum of squares", "1", true};
  report::Series ends;
  ends.name = "ends";
  ends.style = report::Style::kDots;
  report::Table table;
  table.title = "Start and end points";
  table.header = {"start", "half the sum of squares"};
  for (const auto& p : in.record.parameters) {
    table.header.push_back(p.name + " from");
    table.header.push_back("to");
  }
  table.header.push_back("ended");
  table.text_columns = {static_cast<int>(table.header.size()) - 1};
  for (std::size_t i = 0; i < in.record.starts.size(); ++i) {
    const auto& s = in.record.starts[i];
    if (s.cost >= 0.0) {
      ends.x.push_back(static_cast<double>(i + 1));
      ends.y.push_back(s.cost);
    }
    std::vector<std::string> row = {std::to_string(i + 1),
                                    s.cost >= 0.0 ? fmt::format("{:.6g}", s.cost) : "failed"};
    for (std::size_t j = 0; j < in.record.parameters.size(); ++j) {
      row.push_back(fmt::format("{:.4g}", s.from[j]));
      row.push_back(j < s.to.size() ? fmt::format("{:.6g}", s.to[j]) : "-");
    }
    row.push_back(s.message);
    table.rows.push_back(std::move(row));
  }
  chart.series.push_back(ends);
  page->AddChart(chart);
  page->AddTable(table);
}

// The simulated marks with what the parameters' errors leave open, over the measured ones.
void AddBands(const FitPageInput& in, report::Page* page) {
  page->AddSection(
      "Prediction with the estimates",
      "Simulated marks in the model's plane, with a band of two standard errors for what is not "
      "known of the parameters (carried through linearly), over the measured ones.");
  constexpr const char* kAxes[] = {"x", "y"};
  for (std::size_t trial = 0; trial < in.record.trials.size(); ++trial) {
    for (std::size_t m = 0; m < in.record.marks.size(); ++m) {
      report::Chart chart;
      chart.title = in.record.marks[m];
      if (in.record.trials.size() > 1) chart.title += ", " + in.record.trials[trial];
      chart.y = {"position", "m", false};
      for (Eigen::Index axis = 0; axis < 2; ++axis) {
        report::Series measured, simulated;
        measured.name = std::string("measured ") + kAxes[axis];
        measured.style = report::Style::kDots;
        simulated.name = std::string("simulated ") + kAxes[axis];
        measured.color = simulated.color = static_cast<int>(axis);
        for (std::size_t i = 0; i < in.record.t.size(); ++i) {
          if (in.record.mark[i] != static_cast<std::int32_t>(m) ||
              in.record.trial[i] != static_cast<std::int32_t>(trial)) {
            continue;
          }
          const auto column = static_cast<Eigen::Index>(i);
          measured.x.push_back(in.record.t[i]);
          measured.y.push_back(in.record.measured(axis, column));
          simulated.y.push_back(in.record.simulated(axis, column));
          simulated.half_width.push_back(2.0 * in.record.band(axis, column));
        }
        simulated.x = measured.x;
        if (measured.x.empty()) continue;
        chart.series.push_back(std::move(simulated));
        chart.series.push_back(std::move(measured));
      }
      if (!chart.series.empty()) page->AddTimeSeries(std::move(chart));
    }
  }
}

// Where the first trial's clock stands when the model begins [s].
double StartOfModel(const data::FitRecord& record) {
  for (const data::FitRecord::Nuisance& n : record.nuisances) {
    if (n.name == "time offset" && n.trial == 0) return n.value;
  }
  return 0.0;
}

// The structure at the estimate, under the measured marks where there are any.
void AddMovingScene(const FitPageInput& in, report::Page* page) {
  const bool compared = !in.comparison.errors.empty();
  const double start = compared ? in.comparison.alignment.at.offset : StartOfModel(in.record);
  std::optional<report::Motion> motion;
  if (in.motion) motion = MotionOfRun(*in.motion, in.record.marks, start);
  if (motion) motion->note = "The structure at the estimate.";
  if (compared) motion = MotionOfBoth(in.comparison, std::move(motion));
  if (!motion) return;
  if (in.record.trials.size() > 1) motion->title += ", " + in.record.trials.front();
  page->AddMotion(std::move(*motion));
}

void AddSearch(const FitPageInput& in, report::Page* page) {
  page->AddSection("Course of the search",
                   fmt::format("{} of the model; every one is in the file.",
                               Counted(in.record.evaluations.size(), "evaluation")));
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
  AddWaterfall(in, page);
}

}  // namespace

void WriteFitPage(const std::string& path, const FitPageInput& in) {
  report::Page page("Fit", in.record.study);
  Level level = in.result.Usable() ? Level::kGood : Level::kBad;
  for (const auto& p : in.result.parameters) {
    if (in.result.Usable()) level = std::max(level, LevelOfFitPage(p.verdict));
  }
  page.AddWords(level, in.record.verdict, in.record.reasons);
  if (in.record.measured.cols() > 0 || !in.record.channels.empty()) {
    AddParameters(in, &page);
    AddProfiles(in, &page);
    AddMovingScene(in, &page);
    if (!in.comparison.errors.empty()) AddComparisonPanels(in.comparison, &page);
    AddLadder(in.record, &page);
    AddModelError(in, &page);
    AddChannels(in.record, &page);
    AddResiduals(in.problem, in.result, in.record, &page);
    AddBands(in, &page);
    AddSearch(in, &page);
  }
  page.AddOrigin(in.provenance);
  page.Write(path);
}

}  // namespace unfurl::cli
