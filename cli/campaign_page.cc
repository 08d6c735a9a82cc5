#include "cli/campaign_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/number.h"
#include "campaign/inputs.h"
#include "cli/campaign_text.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

using campaign::CampaignAnswers;
using campaign::CampaignRecord;
using campaign::ResponseAnswer;
using TextRows = std::vector<std::vector<std::string>>;

constexpr std::size_t kCampaignPageMostDots =
    1500;                                // of a scatter picture: more are one blot, and megabytes
constexpr std::size_t kMostSteps = 400;  // of a distribution function: finer than pixels

void AddTable(report::Page* page, const std::string& title, const std::string& note,
              const TextRows& rows, std::vector<int> text_columns = {0}) {
  if (rows.size() < 2) return;
  report::Table table;
  table.title = title;
  table.note = note;
  table.header = rows[0];
  table.rows.assign(rows.begin() + 1, rows.end());
  table.text_columns = std::move(text_columns);
  page->AddTable(table);
}

void AddFigures(report::Page* page, const CampaignAnswers& a) {
  std::vector<report::Figure> figures;
  for (const ResponseAnswer& r : a.responses) {
    if (!r.proportion) continue;
    const campaign::Interval& i = r.proportion->interval;
    figures.push_back({"P(" + r.name + ")", Number(r.proportion->value, 3),
                       fmt::format("{} to {} at {:g}%", Number(i.low, 3), Number(i.high, 3),
                                   100.0 * a.confidence),
                       report::Level::kNeutral});
  }
  for (const ResponseAnswer& r : a.responses) {
    if (!r.summary) continue;
    figures.push_back({r.name,
                       NumberWithError(r.summary->mean, r.summary->mean_error) +
                           (r.unit.empty() ? "" : " " + r.unit),
                       "mean; sigma " + Number(r.summary->sigma, 3), report::Level::kNeutral});
  }
  if (!figures.empty()) page->AddFigures(figures);
}

// Finite values, ascending.
std::vector<double> Sorted(const std::vector<double>& values) {
  std::vector<double> out;
  for (const double v : values) {
    if (!std::isnan(v)) out.push_back(v);
  }
  std::sort(out.begin(), out.end());
  return out;
}

void AddDistribution(report::Page* page, const ResponseAnswer& r,
                     const std::vector<double>& values) {
  const std::vector<double> sorted = Sorted(values);
  if (sorted.size() < 2 || sorted.front() == sorted.back()) return;
  report::Chart chart;
  chart.title = "Distribution of " + r.name;
  chart.note = "Part of the runs below each value; the band holds the whole of the true curve.";
  chart.x = {r.name, r.unit};
  chart.y = {"part of the runs", "1", false, 0.0, 1.0};
  report::Series line;
  line.name = r.name;
  const std::size_t n = sorted.size(), steps = std::min(n, kMostSteps);
  for (std::size_t s = 0; s < steps; ++s) {
    const std::size_t i = steps == 1 ? 0 : s * (n - 1) / (steps - 1);
    line.x.push_back(sorted[i]);
    line.y.push_back((static_cast<double>(i) + 0.5) / static_cast<double>(n));
    line.half_width.push_back(r.summary->distribution_band);
  }
  chart.series.push_back(std::move(line));
  page->AddChart(chart);
}

// Every so-manieth run, so that the picture stays one.
void AddScatter(report::Page* page, const CampaignRecord& record, const campaign::Inputs& inputs,
                std::size_t variable, std::size_t response) {
  const data::CampaignVariable& v = record.plan.variables[variable];
  const data::CampaignResponse& r = record.plan.responses[response];
  const std::uint64_t stride = std::max<std::uint64_t>(1, record.runs / kCampaignPageMostDots);
  std::vector<std::pair<double, double>> dots;
  std::vector<double> x(record.plan.variables.size());
  for (std::uint64_t run = 0; run < record.runs; run += stride) {
    if (std::isnan(record.responses[response][run])) continue;
    inputs.Values(run, x);
    dots.emplace_back(x[variable], record.responses[response][run]);
  }
  std::sort(dots.begin(), dots.end());
  report::Chart chart;
  chart.title = r.name + " against " + v.name;
  chart.x = {v.name, v.unit};
  chart.y = {r.name, r.unit};
  report::Series series;
  series.name = r.name;
  series.style = report::Style::kDots;
  for (const auto& [at, value] : dots) {
    series.x.push_back(at);
    series.y.push_back(value);
  }
  if (series.x.empty()) return;
  chart.series.push_back(std::move(series));
  page->AddChart(chart);
}

void AddConvergence(report::Page* page, const CampaignAnswers& a) {
  report::Chart chart;
  chart.title = "What sharpness costs";
  chart.note =
      "Half of each interval, of a probability or over sigma of a mean, from the first runs alone. "
      "Four times the runs halve it.";
  chart.x = {"runs", "1", true};
  chart.y = {"half interval", "1", true};
  for (const ResponseAnswer& r : a.responses) {
    if (!r.convergence) continue;
    const double scale = r.summary && r.summary->sigma > 0.0 ? r.summary->sigma : 1.0;
    report::Series series;
    series.name = r.name;
    for (const campaign::AnswerAt& at : r.convergence->history) {
      if (!std::isfinite(at.half_width) || at.half_width <= 0.0) continue;
      series.x.push_back(static_cast<double>(at.n));
      series.y.push_back(at.half_width / scale);
    }
    if (series.x.size() > 1) chart.series.push_back(std::move(series));
  }
  if (!chart.series.empty()) page->AddChart(chart);
}

void AddFailures(report::Page* page, const CampaignAnswers& a) {
  TextRows rows = {{"why", "runs"}};
  for (const auto& [reason, count] : a.reasons) rows.push_back({reason, fmt::format("{}", count)});
  AddTable(page, "Runs that failed", "", rows, {0});
}

}  // namespace

void WriteCampaignPage(const std::string& path, const CampaignRecord& record,
                       const CampaignAnswers& a, data::Provenance provenance,
                       const std::string& record_path) {
  report::Page page("Campaign", a.name);
  const report::Level level = !a.usable       ? report::Level::kBad
                              : a.failed == 0 ? report::Level::kGood
                                              : report::Level::kCare;
  page.AddWords(level, a.usable ? CampaignHead(a) : a.message, a.notes);
  AddFigures(&page, a);
  AddTable(&page, "Probabilities", "Intervals are exact for independent runs.", ProbabilityRows(a));
  AddTable(
      &page, "Numbers",
      "Of all runs. The interval is the mean's; 5% and 95% are percentiles, left open (-) where "
      "the runs are too few.",
      NumberRows(a));
  AddTable(&page, "Rank correlation",
           "Spearman's, of each response with each variable; in parentheses what may be chance.",
           CorrelationRows(a));
  AddTable(&page, "Shares of the variance, by a surrogate",
           "A polynomial chaos fitted to the runs: the share of each variable with its "
           "interactions, and how much of the variance it explains of runs that it has not seen.",
           SurrogateRows(a));
  AddTable(&page, "What it hangs on", "Shares of the variance of each response: Sobol's indices.",
           ShareRows(a));
  AddTable(&page, "Screening", "Change from one end of a variable to the other (Morris).",
           ScreeningRows(a));
  AddTable(&page, "Tolerance intervals",
           fmt::format("What holds that part of all deployments, with {:g}% confidence.",
                       100.0 * a.confidence),
           ToleranceRows(a));
  const campaign::Inputs inputs(record.plan);
  for (std::size_t k = 0; k < a.responses.size(); ++k) {
    if (a.responses[k].summary) AddDistribution(&page, a.responses[k], record.responses[k]);
  }
  AddConvergence(&page, a);
  page.AddSection("Against each variable");
  for (std::size_t k = 0; k < a.responses.size(); ++k) {
    if (a.responses[k].yes_no || a.responses[k].present == 0) continue;
    for (std::size_t j = 0; j < a.variables.size(); ++j) {
      AddScatter(&page, record, inputs, j, k);
    }
  }
  AddTable(&page, "Extremes", "", ExtremeRows(a));
  AddFailures(&page, a);
  TextRows variables = {{"variable", "distribution"}};
  for (std::size_t j = 0; j < a.variables.size(); ++j) {
    variables.push_back({a.variables[j], a.distributions[j]});
  }
  AddTable(&page, "Variables", "", variables, {0, 1});
  provenance.AddInput(record_path);
  page.AddOrigin(provenance);
  page.Write(path);
}

}  // namespace unfurl::cli
