#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/fixed_number.h"
#include "base/length.h"
#include "base/number.h"
#include "base/text.h"
#include "cli/comparison_panels.h"
#include "cli/motion_panel.h"
#include "correlate/compare/comparison.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

using report::Chart;
using report::Series;
using report::Style;

constexpr double kCorrelatePageBand = 2.0;  // sigmas of the error band

std::vector<double> CorrelatePageScaled(const std::vector<double>& x, double factor,
                                        double zero = 0.0) {
  std::vector<double> out(x);
  for (double& v : out) v = factor * (v - zero);
  return out;
}

std::vector<report::Marker> LatchMarkers(const correlate::Comparison& c) {
  std::vector<report::Marker> out;
  for (const correlate::ModelEvent& e : c.latches) {
    out.push_back({e.t + c.alignment.at.offset, e.where + " latches", -1});
  }
  return out;
}

// Dots with a band for what was measured, a line for the reference.
void AddBoth(const correlate::ComparedSignal& s, const std::string& of, const char* other,
             int color, Chart* chart, double zero = 0.0) {
  const double k = Shown(s.id);
  Series measured{"measured" + of,
                  s.t,
                  CorrelatePageScaled(s.measured, k, zero),
                  CorrelatePageScaled(s.sigma, kCorrelatePageBand * k),
                  Style::kDots,
                  color};
  Series reference{other + of, s.t,          CorrelatePageScaled(s.reference, k, zero),
                   {},         Style::kLine, color + 1};
  if (!s.reference.empty()) chart->series.push_back(std::move(reference));
  chart->series.push_back(std::move(measured));
}

Chart ChannelChart(const correlate::Comparison& c, const correlate::ComparedSignal& s) {
  Chart chart;
  chart.title = s.name;
  for (const correlate::ComparedChannel& one : c.channels) {
    if (one.name == s.name && !one.of.empty() && one.of != s.name)
      chart.title += " (" + one.of + ")";
  }
  chart.y = {s.name, s.id.unit, false};
  AddBoth(s, "", Other(c), 0, &chart);
  chart.markers = LatchMarkers(c);
  return chart;
}

// What the reference leaves of a channel.
Chart ChannelResidual(const correlate::Comparison& c, const correlate::ComparedSignal& s) {
  Chart chart;
  chart.title = s.name + ": measured less " + Other(c);
  chart.y = {"difference", s.id.unit, false};
  chart.height_px = 220;
  std::vector<double> left(s.t.size());
  for (std::size_t i = 0; i < left.size(); ++i) left[i] = s.measured[i] - s.reference[i];
  if (!s.sigma.empty()) {
    chart.series.push_back({"measurement's standard deviation", s.t,
                            std::vector<double>(s.t.size(), 0.0),
                            CorrelatePageScaled(s.sigma, kCorrelatePageBand), Style::kLine, 7});
  }
  chart.series.push_back({"difference", s.t, std::move(left), {}, Style::kDots, 0});
  return chart;
}

void AddMotion(const correlate::Comparison& c, report::Page* page) {
  if (c.reference.empty()) {
    page->AddSection("The record", "As it was read. Drag to zoom; all charts of time follow.");
    for (const correlate::ComparedSignal& s : c.signals) {
      Chart chart = ChannelChart(c, s);
      // Nothing to be told from: a line shows a vibration, where as many dots are a blot.
      for (Series& one : chart.series) one.style = Style::kLine;
      page->AddTimeSeries(std::move(chart));
    }
    return;
  }
  page->AddSection(c.reference_is_run ? "Measured over simulated" : "Comparison in time",
                   fmt::format("Dots: measured, with a band of ±{:.0f} standard deviations. Lines: "
                               "{}. Drag to zoom; all charts of time follow.",
                               kCorrelatePageBand, Other(c)));
  for (const correlate::ComparedSignal& s : c.signals) {
    if (s.id.IsAngle()) page->AddTimeSeries(AngleChart(c, s));
    if (s.id.IsChannel()) page->AddTimeSeries(ChannelChart(c, s));
  }
  const std::vector<std::size_t> order = MarksByMotion(c);
  for (std::size_t i = 0; i < std::min<std::size_t>(order.size(), 2); ++i) {
    page->AddTimeSeries(MarkChart(c, order[i]));
  }
}

void AddPlane(const correlate::Comparison& c, report::Page* page) {
  if (c.marks.empty()) return;
  report::Paths paths;
  paths.title = "The plane of the motion";
  paths.note = "Paths of the marks, both axes to the same scale.";
  paths.x = {"x", "m", false};
  paths.y = {"y", "m", false};
  int color = 0;
  for (std::size_t m = 0; m < c.marks.size(); ++m) {
    const std::string& mark = c.marks[m];
    const correlate::ComparedSignal *x = correlate::FindCoordinate(c, m, 0),
                                    *y = correlate::FindCoordinate(c, m, 1);
    if (x == nullptr || y == nullptr) continue;
    paths.paths.push_back(
        {mark + " " + Other(c), x->reference, y->reference, Style::kLine, color, true});
    paths.paths.push_back(
        {mark + " measured", x->measured, y->measured, Style::kDots, color + 1, false});
    color += 2;
  }
  page->AddPaths(paths);
}

void AddResiduals(const correlate::Comparison& c, report::Page* page) {
  if (c.reference.empty()) return;
  page->AddSection("Residuals",
                   fmt::format("Measured less {}, with a band of ±{:.0f} standard deviations "
                               "of the measurement about zero: where the two agree, the dots fill "
                               "the band and nothing else.{}",
                               Other(c), kCorrelatePageBand,
                               c.marks.empty() ? "" : " z is across the model's plane."));
  for (const correlate::ComparedSignal& s : c.signals) {
    if (s.id.IsChannel()) page->AddTimeSeries(ChannelResidual(c, s));
  }
  for (std::size_t m = 0; m < c.marks.size(); ++m) {
    Chart chart;
    chart.title = c.marks[m] + ": measured less " + Other(c);
    chart.y = {"difference", "mm", false};
    chart.height_px = 220;
    int color = 0;
    for (int axis : {0, 1, 2}) {
      const correlate::ComparedSignal* s = correlate::FindCoordinate(c, m, axis);
      if (s == nullptr) continue;
      std::vector<double> left(s->t.size());
      for (std::size_t i = 0; i < left.size(); ++i) {
        left[i] = kMilli * (s->measured[i] - s->reference[i]);
      }
      if (c.observations.has_sigma && axis == 0) {
        chart.series.push_back(
            {"measurement's standard deviation", s->t, std::vector<double>(s->t.size(), 0.0),
             CorrelatePageScaled(s->sigma, kCorrelatePageBand * kMilli), Style::kLine, 7});
      }
      chart.series.push_back(
          {std::string(1, "xyz"[axis]), s->t, std::move(left), {}, Style::kDots, color++});
    }
    chart.markers = LatchMarkers(c);
    page->AddTimeSeries(std::move(chart));
  }
}

void AddErrors(const correlate::Comparison& c, report::Page* page) {
  if (c.errors.empty()) return;
  report::Table table;
  table.title = "Errors, mark by mark";
  table.note =
      "Root mean squares of the distance between the two, after alignment. "
      "One sigma is the measurement's stated standard deviation.";
  table.rows = MarkErrorRows(c);
  table.header = table.rows.front();
  table.rows.erase(table.rows.begin());
  page->AddTable(table);
}

}  // namespace

std::vector<std::vector<std::string>> MarkErrorRows(const correlate::Comparison& c) {
  const LengthUnit unit = UnitFor(c.errors.back().rmse);  // of all marks
  const auto length = [&](double metres) { return fmt::format("{:.3f}", unit.per_metre * metres); };
  const auto in_unit = [&](const char* what) { return fmt::format("{} [{}]", what, unit.name); };
  std::vector<std::vector<std::string>> rows = {{"mark", "samples", in_unit("RMSE"),
                                                 in_unit("in plane"), in_unit("across"),
                                                 in_unit("largest"), "at [s]", "in sigmas"}};
  for (const correlate::MarkError& e : c.errors) {
    rows.push_back({e.mark, std::to_string(e.samples), length(e.rmse), length(e.rmse_in_plane),
                    length(e.rmse_across), length(e.largest), FixedNumber(e.largest_at, 3),
                    e.sigmas > 0.0 ? fmt::format("{:.2f}", e.sigmas) : "-"});
  }
  return rows;
}

std::vector<std::size_t> MarksByMotion(const correlate::Comparison& c) {
  std::vector<std::pair<double, std::string>> order;
  for (std::size_t mark = 0; mark < c.marks.size(); ++mark) {
    double range = 0.0;
    for (int axis : {0, 1}) {
      const correlate::ComparedSignal* s = correlate::FindCoordinate(c, mark, axis);
      if (s == nullptr || s->measured.empty()) continue;
      const auto [low, high] = std::minmax_element(s->measured.begin(), s->measured.end());
      range = std::max(range, *high - *low);
    }
    order.emplace_back(-range, c.marks[mark]);
  }
  std::vector<std::size_t> out(order.size());
  std::iota(out.begin(), out.end(), std::size_t{0});
  std::sort(out.begin(), out.end(),
            [&](std::size_t a, std::size_t b) { return order[a] < order[b]; });
  return out;
}

report::Chart AngleChart(const correlate::Comparison& c, const correlate::ComparedSignal& s) {
  Chart chart;
  chart.title = "Rotation of the body: " + s.name;
  chart.note = "Two marks on one body give its angle.";
  chart.y = {"angle", ShownUnit(s.id), false};
  AddBoth(s, "", Other(c), 0, &chart);
  chart.markers = LatchMarkers(c);
  return chart;
}

report::Chart MarkChart(const correlate::Comparison& c, std::size_t mark, MarkOrigin origin) {
  const bool from_start = origin == MarkOrigin::kReferenceStart;
  Chart chart;
  chart.title = c.marks[mark] + ": position";
  chart.y = {from_start ? "displacement" : "position", "mm", false};
  chart.height_px = 320;
  for (int axis : {0, 1}) {
    const correlate::ComparedSignal* s = correlate::FindCoordinate(c, mark, axis);
    if (s == nullptr) continue;
    const double zero = from_start && !s->reference.empty() ? s->reference.front() : 0.0;
    AddBoth(*s, axis == 0 ? " x" : " y", Other(c), 2 * axis, &chart, zero);
  }
  chart.markers = LatchMarkers(c);
  return chart;
}

void AddComparisonPanels(const correlate::Comparison& c, report::Page* page) {
  AddMotion(c, page);
  AddPlane(c, page);
  AddResiduals(c, page);
  AddResidualPanels(c, page);
  AddErrors(c, page);
  AddScorePanels(c, page);
  AddSpectrumPanels(c, page);
  AddDensityPanels(c, page);
  AddModePanels(c, page);
}

namespace {

// The reference in motion, by the record's clock, and the measured marks over it.
void AddMovingPicture(const correlate::Comparison& c, report::Page* page) {
  std::optional<report::Motion> motion;
  if (c.reference_is_run && !c.reference.empty()) {
    const data::RunReader run(c.reference);
    const std::vector<std::string> marks =
        c.marks.empty() ? run.file().ReadStrings("/marks") : c.marks;
    motion = MotionOfRun(run, marks, c.alignment.at.offset);
  }
  if (!c.marks.empty()) motion = MotionOfBoth(c, std::move(motion));
  if (motion) page->AddMotion(std::move(*motion));
}

void AddMarksHead(const correlate::Comparison& c, report::Page* page) {
  const correlate::Alignment& a = c.alignment;
  const correlate::MarkError& all = c.errors.back();
  const bool within = all.sigmas > 0.0 && all.sigmas < 1.2;
  page->AddWords(within ? report::Level::kGood : report::Level::kCare, c.verdict, c.reasons);
  page->AddFigures(
      {{"distance, RMS", LengthText(all.rmse),
        all.sigmas > 0.0 ? fmt::format("{:.3g} times the measurement's sigma", all.sigmas) : "",
        within ? report::Level::kGood : report::Level::kCare},
       {"time offset", NumberWithError(a.at.offset, a.Sigma("time offset")) + " s", "",
        report::Level::kNeutral},
       {"across the plane, RMS", LengthText(all.rmse_across),
        "mean " + correlate::MeanText(all.bias_across, all.rmse_across), report::Level::kNeutral},
       {"motion explained", fmt::format("{:.3f} %", 100.0 * a.r2), "R squared of the positions",
        report::Level::kNeutral}});
}

void AddChannelHead(const correlate::Comparison& c, report::Page* page) {
  // Each within its sigma by as much as marks must be.
  constexpr double kWithin = 1.2;
  bool within = !c.scores.empty();
  for (const correlate::ComparedScore& s : c.scores) {
    within = within && s.sigmas > 0.0 && s.sigmas < kWithin;
  }
  const bool alone = c.reference.empty();
  page->AddWords(alone    ? c.measured_doubtful ? report::Level::kCare : report::Level::kNeutral
                 : within ? report::Level::kGood
                          : report::Level::kCare,
                 c.verdict, c.reasons);
  if (alone) return;
  const correlate::Alignment& a = c.alignment;
  page->AddFigures(
      {{"time offset", NumberWithError(a.at.offset, a.Sigma("time offset")) + " s",
        a.Sigma("time offset") > 0.0 ? "" : "known", report::Level::kNeutral},
       {"readings explained", fmt::format("{:.3f} %", 100.0 * a.r2),
        "share of the variance of all channels, each over its sigma", report::Level::kNeutral}});
}

}  // namespace

void WriteComparisonPage(const std::string& path, const correlate::Comparison& c,
                         const data::Provenance& provenance) {
  report::Page page("Correlation",
                    c.reference.empty() ? c.record : c.record + " against " + c.reference);
  if (!c.alignment.Usable()) {
    page.AddWords(report::Level::kBad, c.verdict, c.reasons);
  } else {
    if (c.marks.empty()) {
      AddChannelHead(c, &page);
    } else {
      AddMarksHead(c, &page);
    }
    AddMovingPicture(c, &page);
    AddComparisonPanels(c, &page);
  }
  page.AddOrigin(provenance);
  page.Write(path);
}

}  // namespace unfurl::cli
