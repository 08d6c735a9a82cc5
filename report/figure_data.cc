#include "report/figure_data.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "report/chart.h"
#include "report/escape.h"

namespace unfurl::report {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostRows = 20'000;  // half a megabyte

// Six digits: more than a drawing shows, and short; NaN as null.
Json Value(double value) {
  return std::isfinite(value) ? Json(std::stod(fmt::format("{:.5e}", value))) : Json(nullptr);
}

std::string Block(const Json& header, const Json& columns) {
  const Json data = {{"header", header}, {"columns", columns}};
  return "<script type=\"application/json\" class=\"figure-data\">" +
         EscapeJsonForScript(data.dump(-1, ' ', false, Json::error_handler_t::replace)) +
         "</script>\n";
}

}  // namespace

std::string PathsData(const Paths& paths) {
  std::size_t all = 0;
  for (const Path& path : paths.paths) all += path.x.size();
  if (all == 0 || all > kMostRows) return {};
  Json names = Json::array(), x = Json::array(), y = Json::array();
  for (const Path& path : paths.paths) {
    for (std::size_t i = 0; i < path.x.size(); ++i) {
      names.push_back(path.name);
      x.push_back(Value(path.x[i]));
      y.push_back(Value(path.y[i]));
    }
  }
  return Block({"name", AxisTitle(paths.x), AxisTitle(paths.y)}, {names, x, y});
}

std::string MapData(const Map& map) {
  std::size_t all = 0;
  for (const MapPane& pane : map.panes) all += pane.values.size() + pane.dots.size();
  if (all == 0 || all > kMostRows) return {};
  Json panes = Json::array(), x = Json::array(), y = Json::array(), values = Json::array(),
       labels = Json::array();
  const auto columns = static_cast<std::size_t>(map.columns);
  for (const MapPane& pane : map.panes) {
    const std::size_t rows = columns > 0 ? pane.values.size() / columns : 0;
    for (std::size_t i = 0; i < pane.values.size(); ++i) {
      const std::size_t column = i % columns, row = i / columns;  // by the cell's middle
      const double across = (static_cast<double>(column) + 0.5) / static_cast<double>(columns);
      const double up = (static_cast<double>(row) + 0.5) / static_cast<double>(rows);
      panes.push_back(pane.title);
      x.push_back(Value(map.x_low + across * (map.x_high - map.x_low)));
      y.push_back(Value(map.y_low + up * (map.y_high - map.y_low)));
      values.push_back(Value(pane.values[i]));
      labels.push_back(nullptr);
    }
    for (const MapDot& dot : pane.dots) {
      panes.push_back(pane.title);
      x.push_back(Value(dot.x));
      y.push_back(Value(dot.y));
      values.push_back(Value(dot.value));
      labels.push_back(dot.label);
    }
  }
  return Block({"pane", AxisTitle(map.x), AxisTitle(map.y), AxisTitle(map.value), "point"},
               {panes, x, y, values, labels});
}

}  // namespace unfurl::report
