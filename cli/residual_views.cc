#include "cli/residual_views.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/probability.h"
#include "base/statistics.h"

namespace unfurl::cli {

namespace {

constexpr double kShare = 0.95;   // of the bands
constexpr double kSigmas = 1.96;  // of which a normal value lies within by that share [-]
constexpr int kGrey = 6;          // index into the palette

// The share u at which P(Bin(n, u) >= k) reaches `p`: the p-quantile of the kth smallest of n
// uniform numbers, by halving.
double UniformOrderQuantile(std::size_t k, std::size_t n, double p) {
  double low = 0.0, high = 1.0;
  for (int i = 0; i < 60; ++i) {  // to the last bit that matters
    const double u = 0.5 * (low + high);
    (1.0 - BinomialCdf(k - 1, n, u) < p ? low : high) = u;
  }
  return 0.5 * (low + high);
}

report::Series Level(const std::string& name, double from, double to, double value) {
  return {name, {from, to}, {value, value}, {}, report::Style::kDashes, kGrey};
}

void AddScatter(const ResidualViews& views, report::Page* page) {
  report::Chart chart;
  chart.title = "Residuals, " + views.words;
  chart.note = "In standard deviations: 95% within the dashed lines, and no pattern.";
  chart.x = views.along;
  chart.y = {"residual over its sigma", "1"};
  double low = HUGE_VAL, high = -HUGE_VAL;
  int color = 0;
  for (const ResidualGroup& group : views.groups) {
    if (group.along.empty()) continue;
    low = std::min(low, group.along.front());
    high = std::max(high, group.along.back());
    chart.series.push_back(
        {group.name, group.along, group.value, {}, report::Style::kDots, color++});
  }
  chart.series.push_back(Level("95%", low, high, kSigmas));
  chart.series.push_back(Level("95%, below", low, high, -kSigmas));
  if (views.along.unit == "s") {
    page->AddTimeSeries(std::move(chart));
  } else {
    page->AddChart(chart);
  }
}

// At most so many ranks of n, from 1: all of the ends, every so-manieth between.
std::vector<std::size_t> Ranks(std::size_t n, std::size_t most) {
  std::vector<std::size_t> out;
  const std::size_t ends = std::min(n, most / 4), step = n / most + 1;
  for (std::size_t k = 1; k <= n; ++k) {
    if (k <= ends || k > n - ends || k % step == 0) out.push_back(k);
  }
  return out;
}

void AddDistribution(const ResidualViews& views, report::Page* page) {
  std::vector<double> all;
  for (const ResidualGroup& group : views.groups) {
    all.insert(all.end(), group.value.begin(), group.value.end());
  }
  std::sort(all.begin(), all.end());
  const auto normal = [](std::size_t k, std::size_t n) {
    return NormalQuantile((static_cast<double>(k) - 0.5) / static_cast<double>(n));
  };
  const std::size_t count = all.size();
  const double own = views.independent > 0.0 ? views.independent : static_cast<double>(count);
  const auto n = std::clamp<std::size_t>(static_cast<std::size_t>(std::lround(own)), 2, count);
  report::Chart chart;
  chart.title = "Against a normal distribution, " + views.words;
  chart.note =
      "The residuals in order, each where it would lie were they normal: on the line, and 95% "
      "between the dashed ones. Steeper: larger than thought; bent up and down at the ends: a few "
      "are far too large.";
  chart.x = {"normal quantile", "1"};
  chart.y = {"residual over its sigma", "1"};
  report::Series found{"residuals", {}, {}, {}, report::Style::kDots, 0};
  for (const std::size_t k : Ranks(count, 400)) {
    found.x.push_back(normal(k, count));
    found.y.push_back(all[k - 1]);
  }
  report::Series line{"normal", {}, {}, {}, report::Style::kLine, kGrey}, below, above;
  below = above = {"95% of normal samples", {}, {}, {}, report::Style::kDashes, kGrey};
  above.name += ", above";
  for (const std::size_t k : Ranks(n, 48)) {
    const auto [low, high] = NormalOrderBand(k, n, kShare);
    const double x = normal(k, n);
    line.x.push_back(x);
    line.y.push_back(x);
    below.x.push_back(x);
    below.y.push_back(low);
    above.x.push_back(x);
    above.y.push_back(high);
  }
  chart.series = {std::move(found), std::move(line), std::move(below), std::move(above)};
  if (n < count) chart.note += fmt::format(" Of these {} some {} are independent.", count, n);
  page->AddChart(chart);
}

void AddNeighbours(const ResidualViews& views, report::Page* page) {
  std::size_t fewest = static_cast<std::size_t>(-1);
  for (const ResidualGroup& group : views.groups) fewest = std::min(fewest, group.value.size());
  constexpr std::size_t kMostLags = 40;  // beyond, a drift shows over the axis itself
  const std::size_t lags = std::min(kMostLags, fewest / 4);
  if (lags < 2) return;
  report::Chart chart;
  chart.title = "Likeness of neighbours, " + views.words;
  chart.note = "Autocorrelation of each " + views.of +
               "'s residuals in their order. Of independent ones 95% lie between the dashed lines.";
  chart.x = {"lag", "residuals"};
  chart.y = {"autocorrelation", "1"};
  int color = 0;
  for (const ResidualGroup& group : views.groups) {
    report::Series series{group.name,           {},     Autocorrelations(group.value, lags), {},
                          report::Style::kLine, color++};
    for (std::size_t k = 0; k <= lags; ++k) series.x.push_back(static_cast<double>(k));
    chart.series.push_back(std::move(series));
  }
  const double bound = kSigmas / std::sqrt(static_cast<double>(fewest));
  chart.series.push_back(Level("95%", 0.0, static_cast<double>(lags), bound));
  chart.series.push_back(Level("95%, below", 0.0, static_cast<double>(lags), -bound));
  page->AddChart(chart);
}

void AddTable(const ResidualViews& views, report::Page* page) {
  report::Table table;
  table.title = "Residuals by " + views.of + ", " + views.words;
  table.note =
      "What independent normal residuals of the stated sigma would show is in brackets, two "
      "standard deviations wide.";
  table.header = {views.of,  "residuals",           "mean", "RMS", "beyond 1.96 [%]",
                  "largest", "likeness of the next"};
  for (const ResidualGroup& group : views.groups) {
    const double n = static_cast<double>(group.value.size());
    if (group.value.size() < 2) continue;
    double sum = 0.0, squares = 0.0, beyond = 0.0, most = 0.0;
    for (const double v : group.value) {
      sum += v;
      squares += v * v;
      beyond += std::abs(v) > kSigmas ? 1.0 : 0.0;
      if (std::abs(v) > std::abs(most)) most = v;
    }
    const double outside = 1.0 - kShare;
    table.rows.push_back(
        {group.name, fmt::format("{:.0f}", n),
         fmt::format("{:.3f} (±{:.3f})", sum / n, 2.0 / std::sqrt(n)),
         fmt::format("{:.3f} (1±{:.3f})", std::sqrt(squares / n), 2.0 / std::sqrt(2.0 * n)),
         fmt::format("{:.1f} (5±{:.1f})", 100.0 * beyond / n,
                     200.0 * std::sqrt(outside * kShare / n)),
         fmt::format("{:.2f} ({:.2f})", most, NormalQuantile(0.5 * (1.0 + std::pow(0.5, 1.0 / n)))),
         fmt::format("{:.3f} (±{:.3f})", Autocorrelations(group.value, 1)[1], 2.0 / std::sqrt(n))});
  }
  if (views.own_scale) {
    table.header.erase(table.header.begin() + 3);
    for (auto& row : table.rows) row.erase(row.begin() + 3);
  }
  page->AddTable(table);
}

}  // namespace

bool DivideByRms(ResidualGroup* group) {
  double squares = 0.0;
  for (const double v : group->value) squares += v * v;
  if (!(squares > 0.0)) return false;
  const double rms = std::sqrt(squares / static_cast<double>(group->value.size()));
  for (double& v : group->value) v /= rms;
  return true;
}

std::pair<double, double> NormalOrderBand(std::size_t k, std::size_t n, double share) {
  const double out = 0.5 * (1.0 - share);
  return {NormalQuantile(UniformOrderQuantile(k, n, out)),
          NormalQuantile(UniformOrderQuantile(k, n, 1.0 - out))};
}

std::vector<double> Autocorrelations(const std::vector<double>& value, std::size_t lags) {
  std::vector<double> out(lags + 1, 0.0);
  for (std::size_t k = 0; k <= lags; ++k) {
    for (std::size_t i = k; i < value.size(); ++i) out[k] += value[i] * value[i - k];
  }
  const double all = out[0];
  for (double& v : out) v = all > 0.0 ? v / all : 0.0;
  return out;
}

void AddResidualViews(const ResidualViews& views, report::Page* page) {
  constexpr std::size_t kFewest = 8;  // of fewer no distribution shows
  std::size_t all = 0;
  for (const ResidualGroup& group : views.groups) all += group.value.size();
  if (all < kFewest) return;
  if (views.scatter) AddScatter(views, page);
  AddDistribution(views, page);
  if (views.neighbours) AddNeighbours(views, page);
  AddTable(views, page);
}

}  // namespace unfurl::cli
