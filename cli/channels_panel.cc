#include "cli/channels_panel.h"

#include <cmath>

namespace unfurl::cli {

namespace {

std::string TitleOf(const data::FitRecord::Channel& c, const data::FitRecord& record) {
  std::string title = c.name + " (" + c.quantity + ")";
  if (record.trials.size() > 1) title += ", " + record.trials[static_cast<std::size_t>(c.trial)];
  return title;
}

}  // namespace

void AddChannels(const data::FitRecord& record, report::Page* page) {
  if (record.channels.empty()) return;
  page->AddSection("Channels",
                   "Readings, and the model at the estimate as the instrument would show it (gain, "
                   "bias, delay and low pass applied), by the channel's own clock; below them what "
                   "is left, in units of a reading's sigma.");
  for (const data::FitRecord::Channel& c : record.channels) {
    report::Chart chart, residual;
    chart.title = TitleOf(c, record);
    chart.y = {c.name, c.unit, false};
    residual.title = "Residual of " + chart.title;
    residual.y = {"residual", "sigma", false};
    report::Series measured, simulated, left;
    measured.name = "measured";
    measured.style = report::Style::kDots;
    simulated.name = "simulated";
    left.name = "measured less simulated";
    left.style = report::Style::kDots;
    for (std::size_t i = 0; i < c.t.size(); ++i) {
      measured.x.push_back(c.t[i]);
      measured.y.push_back(c.measured[i]);
      if (std::isnan(c.simulated[i])) continue;
      simulated.x.push_back(c.t[i]);
      simulated.y.push_back(c.simulated[i]);
      left.x.push_back(c.t[i]);
      left.y.push_back((c.measured[i] - c.simulated[i]) / c.sigma[i]);
    }
    measured.color = left.color = 0;
    simulated.color = 1;
    chart.series = {std::move(measured), std::move(simulated)};
    residual.series = {std::move(left)};
    page->AddTimeSeries(std::move(chart));
    page->AddTimeSeries(std::move(residual));
  }
}

}  // namespace unfurl::cli
