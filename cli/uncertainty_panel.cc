#include "cli/uncertainty_panel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/length.h"

namespace unfurl::cli {

std::vector<std::string> LayerTitles(const calib::UncertaintyMap& map) {
  std::vector<std::string> out;
  out.reserve(static_cast<std::size_t>(map.layers));
  const std::size_t cells = static_cast<std::size_t>(map.columns * map.columns);
  for (int layer = 0; layer < map.layers; ++layer) {
    out.push_back(
        fmt::format("z = {:.2f} m", map.Middle(static_cast<std::size_t>(layer) * cells).z()));
  }
  return out;
}

report::Map UncertaintyPanel(const calib::UncertaintyMap& map, const std::string& title,
                             const std::string& note, double high_mm) {
  report::Map out;
  out.title = title;
  out.note = note;
  out.x = {"x", "m"};
  out.y = {"y", "m"};
  out.value = {"error of a found point, 3-D, one sigma", "mm"};
  out.x_low = map.low.x();
  out.x_high = map.high.x();
  out.y_low = map.low.y();
  out.y_high = map.high.y();
  out.columns = map.columns;
  out.high = std::isfinite(high_mm) ? high_mm : 1e3 * map.Quantile(0.98);
  const std::size_t cells = static_cast<std::size_t>(map.columns * map.columns);
  const std::vector<std::string> titles = LayerTitles(map);
  for (std::size_t layer = 0; layer < titles.size(); ++layer) {
    report::MapPane pane{titles[layer], {}, {}};
    for (std::size_t k = 0; k < cells; ++k) {
      pane.values.push_back(1e3 * map.sigma[layer * cells + k]);
    }
    out.panes.push_back(std::move(pane));
  }
  return out;
}

std::vector<std::vector<std::string>> LossTable(const std::vector<calib::PlanCase>& cases) {
  // One unit for all, that of the typical error.
  const double typical = cases.empty() ? std::nan("") : cases[0].map.Quantile(0.5);
  const LengthUnit unit = UnitFor(std::isfinite(typical) ? typical : 1e-3);
  const auto head = [&](const char* what) { return fmt::format("{} [{}]", what, unit.name); };
  std::vector<std::vector<std::string>> table = {
      {"", "of the volume found [%]", head("median"), head("95%"), head("largest")}};
  for (const calib::PlanCase& one : cases) {
    const auto length = [&](double p) {
      const double q = one.map.Quantile(p);
      return std::isfinite(q) ? fmt::format("{:.3f}", unit.per_metre * q) : std::string("-");
    };
    table.push_back({one.name, fmt::format("{:.1f}", 100.0 * one.map.Found()), length(0.5),
                     length(0.95), length(1.0)});
  }
  return table;
}

}  // namespace unfurl::cli
