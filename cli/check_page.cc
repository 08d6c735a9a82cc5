#include "cli/check_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/length.h"
#include "cli/residual_views.h"
#include "cli/space_panel.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

using calib::CheckResult;
using report::Level;

constexpr int kCheckPageSlabs = 3;  // of the volume's height

Level LevelOfCheckPage(const CheckResult& result) {
  if (result.invalid) return Level::kBad;
  return result.chance >= result.options.doubtful ? Level::kGood : Level::kCare;
}

// Where all is well nothing is tried without a camera or a point.
bool TriedWithout(const CheckResult& result) { return result.chance < result.options.doubtful; }

std::string ScaledCell(double value, double scale, int decimals) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", scale * value, decimals) : "-";
}

void AddHead(const CheckResult& result, bool bar, report::Page* page) {
  const Level level = LevelOfCheckPage(result);
  page->AddWords(result.verdict == "doubtful" ? Level::kCare : level,
                 "The calibration is " + result.verdict, result.reasons);
  const auto found = std::count_if(result.points.begin(), result.points.end(),
                                   [](const auto& point) { return std::isfinite(point.error); });
  page->AddFigures(
      {{"p-value of the misfit", fmt::format("{:.2g}", result.chance),
        fmt::format("if the calibration is valid; doubtful below {:g}, no longer valid below {:g}",
                    result.options.doubtful, result.options.invalid),
        level},
       {bar ? "lengths from the bar's" : "points from the survey", LengthText(result.rms),
        "RMS; predicted " + LengthText(result.rms_predicted) + ", of rig, readings and " +
            (bar ? "the bar" : "survey")},
       {bar ? "placements seen whole" : "points found", fmt::format("{}", found),
        fmt::format("of {}", result.points.size())}});
}

void AddCameras(const CheckResult& result, report::Page* page) {
  if (result.cameras.empty()) return;
  report::Table table;
  table.title = "Cameras";
  table.note =
      "By how much all readings of a camera are off, and the least shift that this check shows and "
      "tells from another camera's nine times in ten.";
  table.header = {"camera", "readings", "shift [px]", "\u00b1 [px]", "shows from [px]"};
  const bool misfits = !result.readings.empty();
  if (misfits) {
    table.header.push_back("error, RMS [px]");
    table.header.push_back("predicted [px]");
  }
  if (TriedWithout(result)) table.header.push_back("p-value without it");
  for (const calib::CheckedCamera& camera : result.cameras) {
    table.rows.push_back(
        {camera.name, std::to_string(camera.readings), ScaledCell(camera.shift_px, 1.0, 3),
         ScaledCell(camera.shift_sigma_px, 1.0, 3), ScaledCell(camera.shows_px, 1.0, 2)});
    if (misfits) {
      table.rows.back().push_back(fmt::format("{:.3f}", camera.rms_px));
      table.rows.back().push_back(fmt::format("{:.3f}", camera.rms_predicted_px));
    }
    if (TriedWithout(result)) {
      table.rows.back().push_back(fmt::format("{:.2g}", camera.chance_without));
    }
  }
  page->AddTable(table);
  if (!misfits) return;
  report::Chart chart;
  chart.title = "Readings along the sensor";
  chart.note =
      "Reading less what rig and surveyed place predict, over its sigma. A camera that turned "
      "shows "
      "as many sigmas all along its row; readings of one point share its survey's error.";
  chart.x = {"reading", "px"};
  chart.y = {"misfit over its sigma", "1"};
  ResidualViews views;
  views.of = "camera";
  views.words = "along the sensor";
  views.along = chart.x;
  views.scatter = false;  // it is above
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    std::vector<std::pair<double, double>> dots;
    for (const calib::CheckedReading& r : result.readings) {
      if (r.camera == static_cast<int>(c)) dots.push_back({r.u_px, r.misfit_px / r.predicted_px});
    }
    std::sort(dots.begin(), dots.end());
    report::Series series;
    series.name = result.cameras[c].name;
    series.style = report::Style::kDots;
    for (const auto& [u, misfit] : dots) {
      series.x.push_back(u);
      series.y.push_back(misfit);
    }
    if (!series.x.empty()) views.groups.push_back({series.name, series.x, series.y});
    chart.series.push_back(std::move(series));
  }
  page->AddChart(chart);
  // All readings of a point share its survey's error, so as many are independent as there are
  // points at least.
  for (const calib::CheckedPoint& point : result.points) {
    if (point.at.allFinite()) views.independent += 1.0;
  }
  AddResidualViews(views, page);
}

// Where the points were found, by height, coloured by how many of its sigmas each is off.
void AddPlaces(const data::Rig& rig, const CheckResult& result, bool bar, report::Page* page) {
  report::Map map;
  map.title = bar ? "Placements of the bar" : "Points";
  map.note = std::string("Where ") + (bar ? "the bar's middle was" : "each was") +
             " found; the colour is its error over its standard deviation.";
  map.x = {"x", "m"};
  map.y = {"y", "m"};
  map.value = {"error over its sigma", "1"};
  const Eigen::Vector3d margin = 0.05 * (rig.volume_high - rig.volume_low);
  const Eigen::Vector3d low = rig.volume_low - margin, high = rig.volume_high + margin;
  map.x_low = low.x();
  map.x_high = high.x();
  map.y_low = low.y();
  map.y_high = high.y();
  map.low = 0.0;
  const double step = (high.z() - low.z()) / kCheckPageSlabs;
  for (int slab = 0; slab < kCheckPageSlabs; ++slab) {
    map.panes.push_back({fmt::format("z from {:.2f} to {:.2f} m", low.z() + step * slab,
                                     low.z() + step * (slab + 1)),
                         {},
                         {}});
  }
  for (const calib::CheckedPoint& point : result.points) {
    if (!point.at.allFinite()) continue;
    const int slab =
        std::clamp(static_cast<int>((point.at.z() - low.z()) / step), 0, kCheckPageSlabs - 1);
    const double sigmas = std::abs(point.error) / point.predicted;
    map.panes[static_cast<std::size_t>(slab)].dots.push_back(
        {point.at.x(), point.at.y(), sigmas,
         fmt::format("{}: {}, {:.1f} sigmas", point.id, LengthText(point.error), sigmas), true});
  }
  page->AddMap(map);
}

void AddSpace(const data::Rig& rig, const CheckResult& result, bool bar, report::Page* page) {
  report::Space space = SpaceOf(
      rig, "The check in space",
      "Cameras with what they see when the calibration holds, and what was found, coloured by its "
      "error over its standard deviation.");
  report::SpaceCloud cloud;
  cloud.name = bar ? "placements of the bar" : "what was found";
  cloud.value = {"error over its sigma", "1"};
  cloud.range.low = 0.0;
  std::vector<std::uint32_t> seen(result.points.size(), 0U);
  for (const calib::CheckedReading& r : result.readings) {
    seen[static_cast<std::size_t>(r.point)] |= 1U << static_cast<unsigned>(r.camera);
  }
  for (std::size_t i = 0; i < result.points.size(); ++i) {
    const calib::CheckedPoint& point = result.points[i];
    if (!point.at.allFinite()) continue;
    cloud.points.push_back(
        {PlaceOf(point.at), std::abs(point.error) / point.predicted, point.id, seen[i]});
  }
  KeepWorst(&cloud);
  if (!cloud.points.empty()) space.clouds.push_back(std::move(cloud));
  page->AddSpace(space);
}

void AddPoints(const CheckResult& result, bool bar, report::Page* page) {
  report::Table table;
  table.title = bar ? "Lengths" : "Points";
  const LengthUnit unit = UnitFor(std::max(result.rms, result.rms_predicted));
  table.header = {bar ? "bar" : "point",
                  "x [m]",
                  "y [m]",
                  "z [m]",
                  fmt::format("error [{}]", unit.name),
                  fmt::format("predicted [{}]", unit.name)};
  const bool without = TriedWithout(result);
  if (without) table.header.push_back("p-value without it");
  for (const calib::CheckedPoint& point : result.points) {
    table.rows.push_back({point.id, ScaledCell(point.at.x(), 1.0, 3),
                          ScaledCell(point.at.y(), 1.0, 3), ScaledCell(point.at.z(), 1.0, 3),
                          ScaledCell(point.error, unit.per_metre, 3),
                          ScaledCell(point.predicted, unit.per_metre, 3)});
    if (without) table.rows.back().push_back(fmt::format("{:.2g}", point.chance_without));
  }
  page->AddTable(table);
}

}  // namespace

void WriteCheckPage(const std::string& path, const std::string& input, const data::Rig& rig,
                    const CheckResult& result, bool bar, const data::Provenance& provenance) {
  report::Page page("Check of a calibration", input);
  AddHead(result, bar, &page);
  AddCameras(result, &page);
  AddSpace(rig, result, bar, &page);
  AddPlaces(rig, result, bar, &page);
  AddPoints(result, bar, &page);
  page.AddOrigin(provenance);
  page.Write(path);
}

}  // namespace unfurl::cli
