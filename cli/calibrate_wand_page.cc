#include "cli/calibrate_wand_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/length.h"
#include "calib/plan.h"
#include "calib/verdict.h"
#include "cli/space_panel.h"
#include "report/page.h"

namespace unfurl::cli {
namespace {

using report::Level;

Level LevelOfCalibrateWandPage(const data::Rig& rig) {
  if (rig.verdict == calib::kDoNotUse) return Level::kBad;
  return rig.verdict == calib::kGood ? Level::kGood : Level::kCare;
}

void AddHead(const calib::WandCalibration& result, report::Page* page) {
  const calib::WandReport& report = result.report;
  page->AddWords(LevelOfCalibrateWandPage(result.rig), "The calibration: " + result.rig.verdict,
                 result.rig.reasons);
  const auto check = [&](const char* name) {
    const auto found = result.rig.checks.find(name);
    return found == result.rig.checks.end() ? std::nan("") : found->second;
  };
  page->AddFigures(
      {{"distance of two found points", LengthText(report.distance_sigma),
        "by the calibration, RMS over the volume", LevelOfCalibrateWandPage(result.rig)},
       {"the bar in held-out poses", LengthText(check("held_out_length_rms [m]")),
        "RMS; predicted " + LengthText(check("held_out_length_rms_predicted [m]"))},
       {"poses", fmt::format("{}", report.poses), fmt::format("{} passed over", report.dropped)}});
}

void AddTables(const calib::WandCalibration& result, report::Page* page) {
  report::Table cameras;
  cameras.title = "Cameras";
  cameras.header = {"camera",     "readings",        "left out", "residual, RMS [px]",
                    "floor [px]", "row covered [px]"};
  for (const calib::WandCameraReport& camera : result.report.cameras) {
    cameras.rows.push_back(
        {camera.name, fmt::format("{}", camera.readings), fmt::format("{}", camera.gross),
         fmt::format("{:.4f}", camera.residual_rms_px), fmt::format("{:.4f}", camera.floor_px),
         fmt::format("{:.0f} to {:.0f}", camera.low_px, camera.high_px)});
  }
  page->AddTable(cameras);
  report::Table shapes;
  shapes.title = "What the bar leaves open of the volume's shape";
  shapes.note =
      "Principal changes of shape that fit the readings nearly as well, one sigma of each, "
      "widest first.";
  shapes.header = {"change", "known to [ppm]", "moves the volume's edge by"};
  for (const calib::WandShape& shape : result.report.shapes) {
    shapes.rows.push_back(
        {shape.name, fmt::format("{:.0f}", 1e6 * shape.sigma), LengthText(shape.moved)});
  }
  if (!shapes.rows.empty()) page->AddTable(shapes);
}

void AddPaths(const calib::WandFit& fit, report::Page* page) {
  constexpr const char* kAxes[3] = {"x", "y", "z"};
  constexpr int kPlanes[2][2] = {{0, 1}, {0, 2}};
  for (const auto& plane : kPlanes) {
    report::Paths paths;
    paths.title = fmt::format("The bar, {} and {}", kAxes[plane[0]], kAxes[plane[1]]);
    paths.note = "Every pose that took part. What the bar did not reach was not calibrated.";
    paths.x = {kAxes[plane[0]], "m"};
    paths.y = {kAxes[plane[1]], "m"};
    report::Path bars;
    bars.name = "bar";
    bars.ends = false;
    const int last = fit.data.mark_count() - 1;
    for (int k = 0; k < fit.data.pose_count(); ++k) {
      for (const int mark : {0, last}) {
        const Eigen::Vector3d p = fit.state.Mark(k, mark, 0.0);
        bars.x.push_back(p(plane[0]));
        bars.y.push_back(p(plane[1]));
      }
      bars.x.push_back(std::nan(""));
      bars.y.push_back(std::nan(""));
    }
    paths.paths.push_back(std::move(bars));
    page->AddPaths(paths);
  }
}

// Cameras, and the bar in every pose that took part, its marks by their residuals.
void AddSpace(const calib::WandCalibration& result, report::Page* page) {
  const calib::WandFit& fit = result.fit;
  report::Space space = SpaceOf(
      result.rig, "The rig in space",
      "Cameras with what they see, and the bar in every pose that took part, its marks coloured by "
      "their residuals. Choose a mark for its rays; dashed is a reading that was left out.");
  const int marks = fit.data.mark_count();
  ReadingsCloud readings(static_cast<std::size_t>(fit.data.pose_count() * marks));
  for (std::size_t k = 0; k < fit.data.readings.size(); ++k) {
    const calib::WandReading& r = fit.data.readings[k];
    readings.Add(static_cast<std::size_t>(r.pose * marks + r.mark), r.camera,
                 fit.summary.residual_px[k], 1.0, fit.weighting.use_reading[k] == 0);
  }
  Eigen::Matrix3Xd p(3, fit.data.pose_count() * marks);
  std::vector<std::string> ids;
  report::SpaceLine bars;
  bars.name = "bar";
  const double none = std::nan("");
  for (int pose = 0; pose < fit.data.pose_count(); ++pose) {
    for (int mark = 0; mark < marks; ++mark) {
      p.col(pose * marks + mark) = fit.state.Mark(pose, mark, 0.0);
      ids.push_back(fit.data.poses[static_cast<std::size_t>(pose)] + ", " +
                    fit.data.marks[static_cast<std::size_t>(mark)]);
      bars.points.push_back(PlaceOf(p.col(pose * marks + mark)));
    }
    bars.points.push_back({none, none, none});
  }
  space.clouds.push_back(readings.Cloud(ids, p, {"RMS residual", "px"}));
  space.lines.push_back(std::move(bars));
  calib::MapOptions options;
  space.ellipsoids.push_back(
      EllipsoidsOf(calib::MapUncertainty(result.rig, calib::SeenOnRow(result.rig), options),
                   "uncertainty", std::nan("")));
  page->AddSpace(space);
}

// Residuals of each camera against the pose's number, or the place on the row.
void AddResiduals(const calib::WandFit& fit, bool by_row, report::Page* page) {
  report::Chart chart;
  chart.title = by_row ? "Residuals along the rows" : "Residuals in the order of the poses";
  chart.note = "Reading less prediction, of the readings that take part.";
  chart.x = {by_row ? "reading" : "pose", by_row ? "px" : "1"};
  chart.y = {"residual", "px"};
  for (std::size_t j = 0; j < fit.data.cameras.size(); ++j) {
    std::vector<std::pair<double, double>> dots;
    for (std::size_t k = 0; k < fit.data.readings.size(); ++k) {
      const calib::WandReading& r = fit.data.readings[k];
      if (r.camera != static_cast<int>(j) || fit.weighting.use_reading[k] == 0) continue;
      dots.emplace_back(by_row ? r.u_px : r.pose + 1.0, fit.summary.residual_px[k]);
    }
    std::sort(dots.begin(), dots.end());
    report::Series series;
    series.name = fit.data.cameras[j];
    series.style = report::Style::kDots;
    for (const auto& [x, y] : dots) {
      series.x.push_back(x);
      series.y.push_back(y);
    }
    chart.series.push_back(std::move(series));
  }
  page->AddChart(chart);
}

void AddLengths(const calib::WandReport& report, report::Page* page) {
  std::vector<double> errors;
  for (const calib::WandLength& length : report.lengths) {
    errors.push_back(length.error / length.predicted);
  }
  std::sort(errors.begin(), errors.end());
  report::Chart chart;
  chart.title = "The bar's length in held-out poses";
  chart.note =
      "Error over its prediction, sorted, against the share of poses: 95% should lie between -2 "
      "and 2.";
  chart.x = {"error over prediction", "1"};
  chart.y = {"share of poses", "1"};
  report::Series series;
  series.name = "found";
  for (std::size_t k = 0; k < errors.size(); ++k) {
    series.x.push_back(errors[k]);
    series.y.push_back((static_cast<double>(k) + 0.5) / static_cast<double>(errors.size()));
  }
  chart.series.push_back(std::move(series));
  if (!errors.empty()) page->AddChart(chart);
}

}  // namespace

void WriteCalibrateWandPage(const std::string& path, const std::string& readings,
                            const calib::WandCalibration& result,
                            const data::Provenance& provenance) {
  report::Page page("Calibration by a bar", readings);
  AddHead(result, &page);
  AddTables(result, &page);
  AddSpace(result, &page);
  AddPaths(result.fit, &page);
  AddResiduals(result.fit, false, &page);
  AddResiduals(result.fit, true, &page);
  AddLengths(result.report, &page);
  page.AddOrigin(provenance);
  page.Write(path);
}

}  // namespace unfurl::cli
