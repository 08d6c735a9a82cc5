#include "cli/residuals_panel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/fixed_number.h"
#include "base/length.h"
#include "cli/residual_views.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::cli {

namespace {

// Lags of the chart, in samples: until the correlation that was found has decayed.
std::size_t LagsOf(const correlate::SeriesNoise& noise) {
  constexpr double kFewest = 60.0;   // of noise that is white
  constexpr double kDecayed = 0.05;  // of what it is at lag 0
  double lags = kFewest;
  for (const correlate::MarkovNoise& n : noise.series) {
    if (n.share > 0.0 && n.rho > 0.0) lags = std::max(lags, std::log(kDecayed) / std::log(n.rho));
  }
  return static_cast<std::size_t>(lags);
}

// Mean autocorrelation over all series of residuals, in steps of the samples, up to `lags`.
report::Series Autocorrelation(const correlate::ResidualNoise& noise,
                               const Eigen::VectorXd& residual, std::size_t lags,
                               const std::string& name) {
  constexpr std::size_t kMost = 240;  // points: what a chart can show
  const std::size_t step = (lags + kMost - 1) / kMost;
  std::vector<double> sum(lags / step + 1, 0.0);
  for (const auto& series : noise.series) {
    std::vector<double> x(series.slot.empty() ? 0 : series.slot.back() + 1, 0.0);
    for (std::size_t i = 0; i < series.row.size(); ++i) {
      x[series.slot[i]] = residual(series.row[i]);
    }
    for (std::size_t k = 0; k < sum.size() && k * step < x.size(); ++k) {
      for (std::size_t i = k * step; i < x.size(); ++i) sum[k] += x[i] * x[i - k * step];
    }
  }
  report::Series out;
  out.name = name;
  for (std::size_t k = 0; k < sum.size(); ++k) {
    out.x.push_back(static_cast<double>(k * step));
    out.y.push_back(sum[0] > 0.0 ? sum[k] / sum[0] : 0.0);
  }
  return out;
}

// Of the rows as the fit weights them: whitened in time too, where their noise is not white.
ResidualViews ViewsOf(const correlate::Observations& observations,
                      const correlate::TrialResult& trial, bool several) {
  ResidualViews views;
  views.of = "mark";
  views.words = "whitened" + (several ? ", " + trial.name : std::string());
  views.along = {"time", "s", false};
  views.neighbours = false;  // above, before and after whitening
  const Eigen::VectorXd& residual = trial.registration.residual;
  for (const correlate::RowSeries& series : correlate::RowLayout(observations).series) {
    for (Eigen::Index axis = 0; axis < series.axes; ++axis) {
      ResidualGroup group;
      group.name = series.name;
      if (series.axes > 1) group.name += ", axis " + std::to_string(axis + 1);
      for (std::size_t i = 0; i < series.size(); ++i) {
        if (!series.Known(residual, i)) continue;
        group.along.push_back((*series.t)[i]);
        group.value.push_back(residual(series.Row(i, axis)));
      }
      if (!group.value.empty()) views.groups.push_back(std::move(group));
    }
  }
  return views;
}

}  // namespace

void AddResiduals(const correlate::FitProblem& problem, const correlate::FitResult& result,
                  const data::FitRecord& record, report::Page* page) {
  page->AddSection(
      "Residuals",
      "White residuals have no autocorrelation beyond lag 0. What there is says that "
      "the model, or the optics, are wrong in a way that lasts from sample to sample; "
      "the fit is then weighted for it, and the remainder widens the standard errors.");
  const bool several = result.trials.size() > 1;
  for (const correlate::TrialResult& t : result.trials) {
    report::Chart chart;
    chart.title = "Autocorrelation of the residuals" + (several ? ", " + t.name : std::string());
    chart.x = {"lag", "samples of a mark", false};
    chart.y = {"autocorrelation", "1", false};
    const std::size_t lags = LagsOf(t.noise);
    chart.series.push_back(Autocorrelation(t.plain, t.residual, lags, "unweighted"));
    if (!t.noise.series.empty() && !t.noise.white()) {
      chart.series.push_back(
          Autocorrelation(t.whitened, t.registration.residual, lags, "whitened"));
    }
    page->AddChart(chart);
  }
  for (std::size_t k = 0; k < result.trials.size() && k < problem.trials.size(); ++k) {
    AddResidualViews(ViewsOf(*problem.trials[k].observations, result.trials[k], several), page);
  }
  report::Table table;
  table.title = "Noise found in the residuals";
  table.note =
      "Variance in units of the samples' own; the share of it that is correlated from sample to "
      "sample, and by how much. Axes are those of the whitened residual, close to the rig's.";
  table.header = {"trial", "mark", "axis", "variance", "correlated share", "correlation"};
  table.text_columns = {0, 1, 2};
  constexpr const char* kAxes[] = {"1", "2", "3"};
  for (const auto& n : record.noise) {
    table.rows.push_back({record.trials[static_cast<std::size_t>(n.trial)],
                          record.marks[static_cast<std::size_t>(n.mark)], kAxes[n.axis],
                          fmt::format("{:.3g}", n.variance), fmt::format("{:.3g}", n.share),
                          fmt::format("{:.4g}", n.rho)});
  }
  if (!table.rows.empty()) page->AddTable(table);
  if (record.less_weight.empty()) return;
  report::Table less;
  less.title = "Samples with less weight";
  less.note =
      "The simulated marks depend on the solver's tolerance there, since impacts amplify its "
      "errors; "
      "the weight accounts for this numerical noise.";
  less.header = {"trial", "mark", "from [s]", "to [s]", "solver's noise", "weight"};
  less.text_columns = {0, 1};
  for (const auto& l : record.less_weight) {
    less.rows.push_back({record.trials[static_cast<std::size_t>(l.trial)],
                         record.marks[static_cast<std::size_t>(l.mark)], FixedNumber(l.from, 3),
                         FixedNumber(l.to, 3), LengthText(l.noise),
                         fmt::format("{:.2g}", l.weight)});
  }
  page->AddTable(less);
}

}  // namespace unfurl::cli
