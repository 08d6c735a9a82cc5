#include "cli/repeat_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/number.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

using RepeatRecord = data::FitRecord::Repeat;
using report::Level;

Level LevelOfRepeatPage(const std::string& verdict) {
  return verdict == "alike" || verdict == "one value" || verdict == "scatters" ? Level::kGood
                                                                               : Level::kCare;
}

report::Series RepeatPageBar(const std::string& name, double low, double high, double y,
                             int color) {
  report::Series bar;
  bar.name = name;
  bar.x = {low, high};
  bar.y = {y, y};
  bar.color = color;
  return bar;
}

// Dots at rows, in the order of their values, as a series wants them.
report::Series Dots(const std::string& name, const Eigen::VectorXd& value, int color) {
  std::vector<std::pair<double, double>> at;
  for (Eigen::Index i = 0; i < value.size(); ++i) {
    at.emplace_back(value(i), static_cast<double>(value.size() - i));
  }
  std::sort(at.begin(), at.end());
  report::Series dots;
  dots.name = name;
  dots.style = report::Style::kDots;
  dots.color = color;
  for (const auto& [x, y] : at) dots.x.push_back(x), dots.y.push_back(y);
  return dots;
}

// A forest plot: the trials from the top down, then the mean, then the next one.
void AddForest(const data::FitRecord& record, std::size_t j, report::Page* page) {
  const RepeatRecord& r = record.repeat;
  const auto& p = record.parameters[j];
  const RepeatRecord::Parameter& q = r.parameters[j];
  const auto row = static_cast<Eigen::Index>(j);
  const auto count = static_cast<Eigen::Index>(r.trials.size());
  report::Chart chart;
  chart.title = p.name;
  chart.x = {p.name, p.unit, false};
  chart.y = {"trials from above; 0: mean; -1: the next one", "1", false};
  constexpr int kOwn = 0, kAll = 1, kMean = 2, kNext = 3;  // colours of the palette
  for (Eigen::Index i = 0; i < count; ++i) {
    chart.series.push_back(RepeatPageBar(r.trials[static_cast<std::size_t>(i)], r.low95(row, i),
                                         r.high95(row, i), static_cast<double>(count - i), kOwn));
  }
  chart.series.push_back(Dots("each by itself", r.estimate.row(row), kOwn));
  if (q.scatters) {
    chart.series.push_back(Dots("with what the others say", r.effect.row(row), kAll));
  }
  chart.series.push_back(RepeatPageBar("mean", p.low95, p.high95, 0.0, kMean));
  chart.series.push_back(RepeatPageBar("next", q.next_low95, q.next_high95, -1.0, kNext));
  page->AddChart(chart);
}

void AddValues(const data::FitRecord& record, report::Page* page) {
  const RepeatRecord& r = record.repeat;
  std::vector<report::Figure> figures;
  report::Table table;
  table.title = "Over the trials";
  table.header = {"parameter",       "mean",           "95% of the mean",
                  "scatter",         "95% of scatter", "scatter that would show",
                  "95% of the next", "p of alike",     "unit",
                  "verdict"};
  table.text_columns = {0, 8, 9};
  table.note =
      "Scatter: standard deviation from trial to trial, of the logarithm where it is given in "
      "percent. What all trials share, the model's own error and the calibration's, is in the "
      "intervals of mean and next trial and not in the scatter.";
  for (std::size_t j = 0; j < record.parameters.size(); ++j) {
    const auto& p = record.parameters[j];
    const RepeatRecord::Parameter& q = r.parameters[j];
    figures.push_back({p.name, NumberWithError(p.value, p.sigma) + UnitAfter(p.unit), p.verdict,
                       LevelOfRepeatPage(p.verdict)});
    const auto scatter = [&](double s) {
      return q.log ? fmt::format("{:.2g}%", 100.0 * s) : Number(s, 2);
    };
    table.rows.push_back(
        {p.name, IntervalEnd(p.value, IntervalDigits(p.low95, p.high95, 6)),
         IntervalText(p.low95, p.high95), q.scatters ? scatter(q.scatter) : "-",
         q.scatters ? scatter(q.scatter_low95) + " to " + scatter(q.scatter_high95) : "-",
         q.scatters ? scatter(q.visible) : "-", IntervalText(q.next_low95, q.next_high95),
         Number(q.alike_p, 2), p.unit == "1" ? "" : p.unit, p.verdict});
  }
  page->AddFigures(figures);
  page->AddTable(table);
}

void AddByTrial(const data::FitRecord& record, report::Page* page) {
  const RepeatRecord& r = record.repeat;
  report::Table table;
  table.title = "Trial by trial";
  table.header = {"trial"};
  table.text_columns = {0};
  table.note =
      "By itself; with what the others say; and the probability, by the others alone, of a value "
      "as far out or farther.";
  for (const auto& p : record.parameters) {
    table.header.insert(table.header.end(), {p.name, "with the others", "p"});
  }
  const auto text = [](double x, const char* none) {
    return std::isfinite(x) ? fmt::format("{:.4g}", x) : std::string(none);
  };
  for (std::size_t i = 0; i < r.trials.size(); ++i) {
    std::vector<std::string> row = {r.trials[i]};
    for (Eigen::Index j = 0; j < r.estimate.rows(); ++j) {
      const auto k = static_cast<Eigen::Index>(i);
      row.push_back(text(r.estimate(j, k), "-"));
      row.push_back(text(r.effect(j, k), "-"));
      row.push_back(text(r.left_out_p(j, k), "-"));
    }
    table.rows.push_back(std::move(row));
  }
  page->AddTable(table);
}

void AddNext(const RepeatRecord& r, report::Page* page) {
  if (r.t.empty()) return;
  page->AddSection(
      "The next deployment",
      "Marks in the model's plane at the mean values, with the band in which each "
      "coordinate of the next trial lies at each time with 95%: by the scatter, and by "
      "what so few trials leave open of it. Samples' own errors are not in it.");
  constexpr const char* kAxes[] = {"x", "y"};
  for (std::size_t m = 0; m < r.marks.size(); ++m) {
    report::Chart chart;
    chart.title = r.marks[m];
    chart.y = {"position", "m", false};
    for (Eigen::Index axis = 0; axis < 2; ++axis) {
      report::Series band;
      band.name = kAxes[axis];
      band.color = static_cast<int>(axis);
      for (std::size_t i = 0; i < r.t.size(); ++i) {
        if (r.mark[i] != static_cast<std::int32_t>(m)) continue;
        const auto column = static_cast<Eigen::Index>(i);
        const double low = r.low(axis, column), high = r.high(axis, column);
        band.x.push_back(r.t[i]);
        band.y.push_back(0.5 * (low + high));
        band.half_width.push_back(0.5 * (high - low));
      }
      chart.series.push_back(std::move(band));
    }
    page->AddTimeSeries(std::move(chart));
  }
}

}  // namespace

void WriteRepeatPage(const std::string& path, const data::FitRecord& record,
                     const data::Provenance& provenance) {
  report::Page page("Fit of many trials", record.study);
  Level level = record.repeat.empty() ? Level::kBad : Level::kGood;
  for (const auto& p : record.parameters) {
    if (!record.repeat.empty()) level = std::max(level, LevelOfRepeatPage(p.verdict));
  }
  page.AddWords(level, record.verdict, record.reasons);
  if (!record.repeat.empty()) {
    AddValues(record, &page);
    page.AddSection("Trials",
                    "Each trial's value with its own 95% interval, the mean with its "
                    "interval, and the interval of the next trial's value.");
    for (std::size_t j = 0; j < record.parameters.size(); ++j) AddForest(record, j, &page);
    AddByTrial(record, &page);
    AddNext(record.repeat, &page);
  }
  page.AddOrigin(provenance);
  page.Write(path);
}

}  // namespace unfurl::cli
