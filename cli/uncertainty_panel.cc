#include "cli/uncertainty_panel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace unfurl::cli {

std::vector<std::string> LayerTitles(const calib::UncertaintyMap& map) {
  std::vector<std::string> out;
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

std::vector<LossRow> LossRows(const data::Rig& rig, const calib::Visibility& sees,
                              const calib::MapOptions& options) {
  std::vector<LossRow> rows = {{"all cameras", calib::MapUncertainty(rig, sees, options)}};
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    rows.push_back({"without " + rig.cameras[c].name,
                    calib::MapUncertainty(rig, sees, options, static_cast<int>(c))});
  }
  return rows;
}

std::vector<std::vector<std::string>> LossTable(const std::vector<LossRow>& rows) {
  std::vector<std::vector<std::string>> table = {
      {"", "of the volume found [%]", "median [mm]", "95% [mm]", "largest [mm]"}};
  for (const LossRow& row : rows) {
    const auto mm = [&](double p) {
      const double q = row.map.Quantile(p);
      return std::isfinite(q) ? fmt::format("{:.3f}", 1e3 * q) : std::string("-");
    };
    table.push_back(
        {row.name, fmt::format("{:.1f}", 100.0 * row.map.Found()), mm(0.5), mm(0.95), mm(1.0)});
  }
  return table;
}

}  // namespace unfurl::cli
