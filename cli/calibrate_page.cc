#include "cli/calibrate_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/length.h"
#include "base/number.h"
#include "calib/plan.h"
#include "calib/verdict.h"
#include "cli/residual_views.h"
#include "cli/space_panel.h"
#include "cli/uncertainty_panel.h"
#include "report/page.h"

namespace unfurl::cli {

namespace {

using calib::Calibration;
using report::Level;

constexpr std::size_t kWorst = 15;      // held-out points in the table, the worst first
constexpr int kCalibratePageSlabs = 3;  // of the volume's height, for dots

std::string Cell(const Calibration& result, const char* check, double scale, int decimals) {
  const auto found = result.rig.checks.find(check);
  return found == result.rig.checks.end() ? "-"
                                          : fmt::format("{:.{}f}", scale * found->second, decimals);
}

std::string LengthCell(const Calibration& result, const char* check) {
  const auto found = result.rig.checks.find(check);
  return found == result.rig.checks.end() ? "-" : LengthText(found->second);
}

Level LevelOfCalibratePage(const std::string& verdict) {
  if (verdict == calib::kGood) return Level::kGood;
  return verdict == calib::kWithCare ? Level::kCare : Level::kBad;
}

void AddHead(const Calibration& result, report::Page* page) {
  page->AddWords(LevelOfCalibratePage(result.rig.verdict), "Verdict: " + result.rig.verdict,
                 result.rig.reasons);
  const auto& report = result.report;
  page->AddFigures(
      {{"error of a found point (predicted, median)",
        LengthCell(result, "own_error_median_predicted [m]"), "3-D, of calibration and readings"},
       {"held-out points from the survey", LengthCell(result, "held_out_rms [m]"),
        "predicted " + LengthCell(result, "held_out_rms_predicted [m]") +
            ", with the survey's own error"},
       {"95% of them within", LengthCell(result, "held_out_p95 [m]"),
        "largest " + LengthCell(result, "held_out_max [m]")},
       {"lens model", report.order == calib::kOrderByCamera ? "by camera" : report.lens_model,
        !report.lenses.empty() ? "from --lenses"
        : report.order_chosen  ? "by cross-validation"
                               : "as given by --order"},
       {"left out as gross",
        fmt::format("{} readings, {} points", Cell(result, "gross_readings [1]", 1.0, 0),
                    Cell(result, "gross_points [1]", 1.0, 0)),
        fmt::format("of {} and {}", report.readings.size(), report.survey_weight.size())}});
}

void AddGross(const Calibration& result, report::Page* page) {
  if (result.report.gross.empty()) return;
  report::Table table;
  table.title = "Gross errors";
  table.note = "Left out of the fit. Correct obvious mistakes in the survey and calibrate again.";
  table.header = {"kind", "what", "size"};
  table.text_columns = {0, 1};
  for (const calib::GrossFinding& finding : result.report.gross) {
    table.rows.push_back(
        {calib::Name(finding.kind), finding.text,
         finding.camera >= 0 ? fmt::format("{:.2f} px", finding.size) : LengthText(finding.size)});
  }
  page->AddTable(table);
}

void AddCameras(const Calibration& result, report::Page* page) {
  report::Table table;
  table.title = "Cameras";
  table.note =
      "The floor is what had to be added to each reading's sigma for the lens model's own error. "
      "The "
      "last two columns are the part of the sensor on which there were readings: outside it the "
      "model "
      "extrapolates.";
  table.header = {"camera",     "x [m]",      "y [m]",    "z [m]",
                  "f [px]",     "readings",   "left out", "residual RMS [px]",
                  "floor [px]", "from pixel", "to pixel"};
  for (std::size_t j = 0; j < result.rig.cameras.size(); ++j) {
    const data::RigCamera& c = result.rig.cameras[j];
    const calib::CameraReport& fit = result.report.cameras[j];
    table.rows.push_back({c.name, fmt::format("{:.4f}", c.p_WC.x()),
                          fmt::format("{:.4f}", c.p_WC.y()), fmt::format("{:.4f}", c.p_WC.z()),
                          fmt::format("{:.2f}", c.f_px), std::to_string(fit.readings),
                          std::to_string(fit.gross), fmt::format("{:.4f}", fit.residual_rms_px),
                          fmt::format("{:.4f}", fit.floor_px), fmt::format("{:.0f}", fit.low_px),
                          fmt::format("{:.0f}", fit.high_px)});
  }
  page->AddTable(table);
}

void AddResiduals(const Calibration& result, report::Page* page) {
  report::Chart chart;
  chart.title = "Residuals along the sensor";
  chart.note =
      "Reading less prediction, over what one expects of it (its sigma and its redundancy): within "
      "3 "
      "where all is well, and without a pattern along the sensor.";
  chart.x = {"reading", "px"};
  chart.y = {"residual over its sigma", "1"};
  ResidualViews views;
  views.of = "camera";
  views.words = "along the sensor";
  views.along = chart.x;
  views.scatter = false;  // it is above
  for (std::size_t j = 0; j < result.report.cameras.size(); ++j) {
    std::vector<std::pair<double, double>> points;
    for (const calib::ReadingReport& r : result.report.readings) {
      if (r.camera != static_cast<int>(j) || !(r.weight > 0.0) || r.redundancy < 0.01) continue;
      points.push_back({r.u_px, r.residual_px / (r.sigma_px * std::sqrt(r.redundancy))});
      views.independent += r.redundancy;
    }
    std::sort(points.begin(), points.end());
    report::Series series;
    series.name = result.report.cameras[j].name;
    series.style = report::Style::kDots;
    for (const auto& [u, residual] : points) {
      series.x.push_back(u);
      series.y.push_back(residual);
    }
    views.groups.push_back({series.name, series.x, series.y});
    chart.series.push_back(std::move(series));
  }
  page->AddChart(chart);
  AddResidualViews(views, page);
}

// Surveyed points by height, coloured by a value of their own.
void AddDots(const calib::Observations& data, const Calibration& result,
             const std::vector<double>& value, const std::string& title, const std::string& note,
             const report::Axis& axis, report::Page* page) {
  report::Map map;
  map.title = title;
  map.note = note;
  map.x = {"x", "m"};
  map.y = {"y", "m"};
  map.value = axis;
  const Eigen::Vector3d low = result.rig.volume_low, high = result.rig.volume_high;
  const Eigen::Vector3d margin = 0.05 * (high - low);
  map.x_low = low.x() - margin.x();
  map.x_high = high.x() + margin.x();
  map.y_low = low.y() - margin.y();
  map.y_high = high.y() + margin.y();
  const double step = (high.z() - low.z()) / kCalibratePageSlabs;
  for (int slab = 0; slab < kCalibratePageSlabs; ++slab) {
    map.panes.push_back({fmt::format("z from {:.2f} to {:.2f} m", low.z() + step * slab,
                                     low.z() + step * (slab + 1)),
                         {},
                         {}});
  }
  for (int i = 0; i < data.points(); ++i) {
    const auto point = static_cast<std::size_t>(i);
    if (!std::isfinite(value[point]) || result.report.survey_weight[point] < 1.0) continue;
    const int slab =
        std::clamp(static_cast<int>((data.p(2, i) - low.z()) / step), 0, kCalibratePageSlabs - 1);
    map.panes[static_cast<std::size_t>(slab)].dots.push_back(
        {data.p(0, i), data.p(1, i), value[point],
         fmt::format("{}: {:.3f} {}", data.ids[point], value[point], axis.unit)});
  }
  page->AddMap(map);
}

// All of it in space: cameras, surveyed points by residual or held-out error, uncertainty.
void AddSpace(const calib::Observations& data, const Calibration& result,
              const calib::UncertaintyMap& map, report::Page* page) {
  report::Space space = SpaceOf(
      result.rig, "The rig in space",
      "Cameras with what they see, surveyed points by their residuals, and the uncertainty of a "
      "found point. Choose a point for its rays; dashed is a reading that was left out as gross.");
  ReadingsCloud readings(data.ids.size());
  for (const calib::ReadingReport& r : result.report.readings) {
    readings.Add(static_cast<std::size_t>(r.point), r.camera, r.residual_px,
                 r.redundancy < 0.01 ? 0.0 : r.sigma_px * std::sqrt(r.redundancy),
                 !(r.weight > 0.0));
  }
  space.clouds.push_back(readings.Cloud(data.ids, data.p, {"RMS residual over its sigma", "1"}));
  report::SpaceCloud held_out{"held-out points", {"distance from the survey", "mm"}, {}, {}};
  for (const calib::HeldOutPoint& point : result.report.held_out) {
    held_out.points.push_back({PlaceOf(data.p.col(point.point)), 1e3 * point.error.norm(),
                               data.ids[static_cast<std::size_t>(point.point)]});
  }
  KeepWorst(&held_out);
  if (!held_out.points.empty()) space.clouds.push_back(std::move(held_out));
  space.ellipsoids.push_back(EllipsoidsOf(map, "uncertainty", std::nan("")));
  page->AddSpace(space);
}

void AddVolume(const calib::Observations& data, const Calibration& result, report::Page* page) {
  page->AddSection("Over the volume");
  calib::MapOptions options;
  const calib::UncertaintyMap map =
      calib::MapUncertainty(result.rig, calib::SeenOnRow(result.rig), options);
  AddSpace(data, result, map, page);
  const double none = std::nan("");
  std::vector<double> contradiction(data.ids.size(), 0.0), count(data.ids.size(), 0.0);
  for (const calib::ReadingReport& r : result.report.readings) {
    if (!(r.weight > 0.0)) continue;
    contradiction[static_cast<std::size_t>(r.point)] += r.residual_px * r.residual_px;
    count[static_cast<std::size_t>(r.point)] += 1.0;
  }
  for (std::size_t i = 0; i < count.size(); ++i) {
    contradiction[i] = count[i] > 3.0 ? std::sqrt(contradiction[i] / count[i]) : none;
  }
  AddDots(data, result, contradiction, "Residuals of the readings",
          "RMS over the cameras that see the point; only points with redundant readings.",
          {"residual", "px"}, page);
  std::vector<double> held_out(data.ids.size(), none);
  for (const calib::HeldOutPoint& point : result.report.held_out) {
    held_out[static_cast<std::size_t>(point.point)] = 1e3 * point.error.norm();
  }
  AddDots(
      data, result, held_out, "Held-out points",
      "Distance of each from the survey when it took no part in the fit; the survey's own error "
      "is in it.",
      {"distance", "mm"}, page);
  page->AddMap(UncertaintyPanel(
      map, "Uncertainty",
      fmt::format("Of a point found with readings of {} px: calibration and readings. Grey: fewer "
                  "than three cameras see it, or their planes are too near to parallel.",
                  options.reading_sigma_px),
      std::nan("")));
}

void AddWorst(const calib::Observations& data, const Calibration& result, report::Page* page) {
  std::vector<std::size_t> order(result.report.held_out.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto& held = result.report.held_out;
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return held[a].squared > held[b].squared; });
  report::Table table;
  table.title = "Worst of the held-out points";
  table.header = {"point",   "x [m]",  "y [m]",     "z [m]",
                  "cameras", "off by", "predicted", "in sigmas"};
  for (std::size_t k = 0; k < order.size() && k < kWorst; ++k) {
    const calib::HeldOutPoint& point = held[order[k]];
    const Eigen::Vector3d p = data.p.col(point.point);
    table.rows.push_back({data.ids[static_cast<std::size_t>(point.point)], Number(p.x(), 5),
                          Number(p.y(), 5), Number(p.z(), 5), std::to_string(point.readings),
                          LengthText(point.error.norm()),
                          LengthText(std::sqrt(point.predicted.trace())),
                          fmt::format("{:.2f}", std::sqrt(point.squared / 3.0))});
  }
  page->AddTable(table);
}

void AddOrders(const Calibration& result, report::Page* page) {
  if (result.report.orders.empty()) return;
  report::Table table;
  table.title = "Lens models";
  table.note =
      "Each fitted without a fifth of the points in turn. What counts is how likely the left-out "
      "points' readings were; the simplest model that loses next to nothing is taken.";
  table.header = {
      "model",           "log likelihood lost [nats]", "misclosure of the readings [px]",
      "from the survey", "largest floor [px]",         "seconds"};
  for (const calib::OrderTrial& trial : result.report.orders) {
    std::string name = calib::OrderName(trial);
    if (trial.order == result.report.order) name += " (taken)";
    table.rows.push_back(
        {name, fmt::format("{:.1f}", trial.loss), fmt::format("{:.4f}", trial.contradiction_px),
         LengthText(trial.held_out_rms), fmt::format("{:.4f}", trial.largest_floor_px),
         fmt::format("{:.2f}", trial.seconds)});
  }
  page->AddTable(table);
}

void AddWeak(const Calibration& result, report::Page* page) {
  if (result.report.weak.empty()) return;
  report::Table table;
  table.title = "What the survey barely determines";
  table.note =
      "Directions in a camera's parameters that are not known to 1 mrad, 0.3% of the distance to "
      "the "
      "volume (0.15% of it between the two centres), 0.1% of image scale, 0.1% of the row in "
      "offset, "
      "or 0.05% of it at the edge of the field. What one sigma does to found points says whether "
      "it "
      "matters.";
  table.header = {"camera",          "direction", "sigma", "known from the prior [%]",
                  "moves points by", "advice"};
  table.text_columns = {0, 1, 5};
  for (const calib::WeakDirection& weak : result.report.weak) {
    table.rows.push_back({result.rig.cameras[static_cast<std::size_t>(weak.camera)].name, weak.name,
                          fmt::format("{:.2g} {}", weak.sigma, weak.unit),
                          fmt::format("{:.0f}", 100.0 * weak.by_prior), LengthText(weak.point_rms),
                          weak.advice});
  }
  page->AddTable(table);
}

}  // namespace

void WriteCalibratePage(const std::string& path, const std::string& survey,
                        const calib::Observations& data, const calib::Calibration& result,
                        const data::Provenance& provenance) {
  report::Page page("Calibration", survey);
  AddHead(result, &page);
  AddGross(result, &page);
  AddCameras(result, &page);
  AddResiduals(result, &page);
  AddVolume(data, result, &page);
  AddWorst(data, result, &page);
  AddOrders(result, &page);
  AddWeak(result, &page);
  page.AddOrigin(provenance);
  page.Write(path);
}

}  // namespace unfurl::cli
