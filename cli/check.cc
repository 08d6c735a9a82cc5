#include "calib/check.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/error.h"
#include "base/length.h"
#include "base/table.h"
#include "base/text.h"
#include "calib/wand_data.h"
#include "campaign/json_number.h"
#include "cli/check_page.h"
#include "cli/verb.h"
#include "data/rig.h"
#include "data/survey.h"
#include "data/survey_points.h"

namespace unfurl::cli {

namespace {

std::string Cell(double value, double scale, const char* format) {
  return std::isfinite(value) ? fmt::format(fmt::runtime(format), scale * value) : "-";
}

// Of a point that was not found neither is known: it is shown first.
double OverPrediction(const calib::CheckedPoint& point) {
  const double ratio = point.error / point.predicted;
  return std::isfinite(ratio) ? ratio : std::numeric_limits<double>::infinity();
}

// The error over its prediction from which on a point is listed on a terminal, which shows a screen
// of them.
double LeastShown(const std::vector<calib::CheckedPoint>& points) {
  constexpr std::size_t kScreen = 20;  // rows: a screen of 24, less the verdict above them
  std::vector<double> ratios;
  ratios.reserve(points.size());
  for (const calib::CheckedPoint& point : points) ratios.push_back(OverPrediction(point));
  if (ratios.size() <= kScreen) return -1.0;
  std::nth_element(ratios.begin(), ratios.begin() + kScreen - 1, ratios.end(), std::greater<>());
  return ratios[kScreen - 1];
}

// The table of points, or of a bar's placements: of more than a screen the worst.
std::string PointsText(const calib::CheckResult& result, bool bar) {
  const LengthUnit unit = UnitFor(std::max(result.rms, result.rms_predicted));
  std::vector<std::vector<std::string>> rows = {{bar ? "bar" : "point",
                                                 fmt::format("error [{}]", unit.name),
                                                 fmt::format("predicted [{}]", unit.name)}};
  const double least_shown = LeastShown(result.points);
  for (const calib::CheckedPoint& point : result.points) {
    if (!(OverPrediction(point) >= least_shown)) continue;
    rows.push_back({point.id, Cell(point.error, unit.per_metre, "{:.3f}"),
                    Cell(point.predicted, unit.per_metre, "{:.3f}")});
  }
  std::string text = AlignedTable(rows);
  if (rows.size() <= result.points.size()) {
    text += fmt::format("  (the {} worst of {}; all: --report, --json)\n", rows.size() - 1,
                        result.points.size());
  }
  return text;
}

using nlohmann::ordered_json;

struct CheckArguments {
  std::string rig, input, report, need, bar;
  double bar_sigma = 0.0;  // [m]
  calib::CheckOptions options;
};

// "1.2" in metres, "1200mm", or as of a wand "1.2m+-0.1mm".
calib::Bar BarOf(const CheckArguments& arguments) {
  calib::Bar bar{0.0, arguments.bar_sigma};
  const auto has = [&](const char* sign) { return arguments.bar.find(sign) != std::string::npos; };
  if (has("+-") || has("+/-") || has("\u00b1")) {
    const calib::WandBar stated = calib::ParseBar(arguments.bar, "--bar");
    if (bar.sigma > 0.0) {
      throw Error("is stated by --bar, too", "--bar-sigma", "leave one of them out");
    }
    bar = {stated.places[0], stated.sigma};
    if (stated.places.size() == 1 && bar.length > 0.0) return bar;
  } else if ((ParseDouble(Trim(arguments.bar), &bar.length) ||
              ParseLength(Trim(arguments.bar), &bar.length)) &&
             bar.length > 0.0 && std::isfinite(bar.length)) {
    return bar;
  }
  throw Error(fmt::format("'{}' is no length of a bar with two ends", arguments.bar), "--bar",
              "write 1.2 for metres, or 1.2m+-0.1mm");
}

int RunCheck(const Common& common, const CheckArguments& arguments) {
  data::Provenance provenance = StartProvenance(common);
  const bool bar = !arguments.bar.empty();
  const calib::Bar length = bar ? BarOf(arguments) : calib::Bar{};
  const data::Rig rig = data::ReadRig(arguments.rig);
  provenance.AddInput(arguments.rig);
  provenance.AddInput(arguments.input);
  calib::CheckResult result;
  calib::CheckOptions options = arguments.options;
  options.need = NeedOption(arguments.need);
  if (bar) {
    result = calib::CheckBar(rig, data::ReadReadingsCsv(arguments.input), length, arguments.input,
                             options);
  } else {
    result = calib::CheckPoints(rig, data::ReadSurvey(arguments.input), arguments.input, options);
  }

  ordered_json summary = {{"rig", arguments.rig},
                          {"input", arguments.input},
                          {"verdict", result.verdict},
                          {"reasons", result.reasons},
                          {"chance", result.chance},
                          {"rms", result.rms},
                          {"rms_predicted", result.rms_predicted}};
  for (const calib::CheckedPoint& point : result.points) {
    summary["points"].push_back({{"id", point.id},
                                 {"error", point.error},
                                 {"predicted", point.predicted},
                                 {"chance_without", point.chance_without}});
  }
  std::vector<std::vector<std::string>> cameras = {
      {"camera", "readings", "shift [px]", "+- [px]", "shows from [px]", "p-value without it"}};
  for (const calib::CheckedCamera& camera : result.cameras) {
    summary["cameras"].push_back({{"name", camera.name},
                                  {"readings", camera.readings},
                                  {"shift_px", camera.shift_px},
                                  {"shift_sigma_px", campaign::NumberOrNull(camera.shift_sigma_px)},
                                  {"shows_px", campaign::NumberOrNull(camera.shows_px)},
                                  {"chance_without", camera.chance_without}});
    if (!bar) {
      summary["cameras"].back()["rms_px"] = camera.rms_px;
      summary["cameras"].back()["rms_predicted_px"] = camera.rms_predicted_px;
    }
    cameras.push_back(
        {camera.name, std::to_string(camera.readings), Cell(camera.shift_px, 1.0, "{:+.3f}"),
         Cell(camera.shift_sigma_px, 1.0, "{:.3f}"), Cell(camera.shows_px, 1.0, "{:.2f}"),
         fmt::format("{:.2g}", camera.chance_without)});
  }
  summary["causes"] = ordered_json::array();
  for (const calib::CheckedCause& cause : result.causes) {
    ordered_json one = {{"kind", calib::Name(cause.kind)}};
    if (cause.camera >= 0) {
      one["camera"] = result.cameras[static_cast<std::size_t>(cause.camera)].name;
    }
    if (cause.point >= 0) one["point"] = result.points[static_cast<std::size_t>(cause.point)].id;
    const bool pixels =
        cause.kind == calib::CauseKind::kCamera || cause.kind == calib::CauseKind::kReading;
    one["size"] = campaign::NumberOrNull(cause.size);
    one["sigma"] = campaign::NumberOrNull(cause.sigma);
    one["unit"] = pixels ? "px" : "m";
    one["probability"] = cause.probability;
    summary["causes"].push_back(one);
  }
  std::string text = fmt::format("The calibration is {}.\n", result.verdict);
  for (const std::string& reason : result.reasons) text += "  - " + reason + "\n";
  text += "\n" + PointsText(result, bar);
  if (!result.cameras.empty()) text += "\n" + AlignedTable(cameras);
  if (!arguments.report.empty()) {
    WriteCheckPage(arguments.report, arguments.input, rig, result, bar, provenance);
  }
  Finish(common, summary, text);
  if (!result.invalid) return kExitGood;
  return NotUsable(arguments.input,
                   "the calibration is " + result.verdict +
                       (result.reasons.empty() ? "" : ": " + result.reasons.front()));
}

}  // namespace

Verb AddCheck(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(program, common, "check",
                          "Is a calibration still valid? From some points, or a bar of known "
                          "length",
                          "unfurl check rig.h5 ten_points.csv\n"
                          "  unfurl check rig.h5 bar_readings.csv --bar 1.2m+-0.05mm");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto arguments = std::make_shared<CheckArguments>();
  files.Read("RIG", &arguments->rig, "The rig to check [HDF5]")->required();
  files
      .Read("READINGS", &arguments->input,
            "A survey of some points [CSV, HDF5]; with --bar, readings of the bar's ends, ids "
            "1a, 1b, 2a, 2b, ... [CSV]")
      ->required();
  auto* length = app->add_option("--bar", arguments->bar,
                                 "Length of the bar in metres, or with its unit and how well it is "
                                 "known, as 1.2m+-0.1mm")
                     ->type_name("LENGTH");
  app->add_option("--bar-sigma", arguments->bar_sigma, "Standard deviation of that length [m]")
      ->check(CLI::NonNegativeNumber)
      ->needs(length);
  AddNeedOption(app, &arguments->need);
  app->add_option("--doubtful", arguments->options.doubtful,
                  "Probability of a misfit below which the calibration is called doubtful")
      ->capture_default_str();
  app->add_option("--invalid", arguments->options.invalid, "The same for no longer valid")
      ->capture_default_str();
  files.Page(&arguments->report,
             "A page: verdict, cameras along the sensor, points or lengths [HTML]");
  verb.run = [&common, arguments] { return RunCheck(common, *arguments); };
  return verb;
}

}  // namespace unfurl::cli
