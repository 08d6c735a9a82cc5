#include "cli/calibrate_wand.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/count.h"
#include "base/error.h"
#include "base/length.h"
#include "base/progress.h"
#include "base/table.h"
#include "calib/layout.h"
#include "calib/verdict.h"
#include "calib/wand_given.h"
#include "cli/calibrate_json.h"
#include "cli/calibrate_wand_page.h"
#include "data/lab.h"
#include "data/rig.h"
#include "data/survey.h"
#include "data/survey_points.h"
#include "data/wand.h"
#include "measure/survey_readings.h"

namespace unfurl::cli {
namespace {

using nlohmann::ordered_json;

ordered_json Json(const calib::WandCalibration& result, const WandArguments& arguments) {
  const calib::WandReport& report = result.report;
  ordered_json out = {{"readings", arguments.readings},
                      {"rig", arguments.out},
                      {"verdict", result.rig.verdict},
                      {"reasons", result.rig.reasons},
                      {"frame", report.frame},
                      {"handed", report.handed},
                      {"poses", report.poses},
                      {"poses_dropped", report.dropped},
                      {"distance_sigma", report.distance_sigma},
                      {"model_floor_px", result.rig.model_floor_px}};
  for (std::size_t j = 0; j < report.cameras.size(); ++j) {
    const calib::WandCameraReport& camera = report.cameras[j];
    const data::RigCamera& found = result.rig.cameras[j];
    out["cameras"].push_back({{"name", camera.name},
                              {"position", {found.p_WC.x(), found.p_WC.y(), found.p_WC.z()}},
                              {"f_px", found.f_px},
                              {"u0_px", found.u0_px},
                              {"readings", camera.readings},
                              {"gross", camera.gross},
                              {"residual_rms_px", camera.residual_rms_px},
                              {"floor_px", camera.floor_px}});
  }
  for (std::size_t m = 0; m < report.marks.size(); ++m) {
    const auto k = static_cast<Eigen::Index>(m);
    out["marks"].push_back(
        {{"name", report.marks[m]}, {"place", report.place(k)}, {"sigma", report.place_sigma(k)}});
  }
  out["shapes"] = ordered_json::array();
  for (const calib::WandShape& shape : report.shapes) {
    out["shapes"].push_back(
        {{"name", shape.name}, {"strain", shape.sigma}, {"moved", shape.moved}});
  }
  out["lenses"] = LensesJson(report.lenses);
  for (const auto& [name, value] : result.rig.checks) {
    out["checks"][name] = std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
  }
  return out;
}

std::string Text(const calib::WandCalibration& result, const std::string& out) {
  const calib::WandReport& report = result.report;
  std::string text = fmt::format("Verdict: {}\n", result.rig.verdict);
  for (const std::string& reason : result.rig.reasons) text += "  - " + reason + "\n";
  std::vector<std::vector<std::string>> rows = {{"camera", "f [px]", "u0 [px]", "x [m]", "y [m]",
                                                 "z [m]", "readings", "residual [px]", "floor [px]",
                                                 "gross"}};
  for (std::size_t j = 0; j < report.cameras.size(); ++j) {
    const data::RigCamera& camera = result.rig.cameras[j];
    const calib::WandCameraReport& fit = report.cameras[j];
    rows.push_back({camera.name, fmt::format("{:.2f}", camera.f_px),
                    fmt::format("{:.2f}", camera.u0_px), fmt::format("{:.4f}", camera.p_WC.x()),
                    fmt::format("{:.4f}", camera.p_WC.y()), fmt::format("{:.4f}", camera.p_WC.z()),
                    fmt::format("{}", fit.readings), fmt::format("{:.4f}", fit.residual_rms_px),
                    fmt::format("{:.4f}", fit.floor_px), fmt::format("{}", fit.gross)});
  }
  text += "\n" + AlignedTable(rows);
  text += fmt::format(
      "  chi-square per degree of freedom {:.3f} ({:.0f} degrees); {} of the bar; distances "
      "between found points to {} by the calibration (RMS)\n\n",
      report.degrees_of_freedom > 0.0 ? report.chi_square / report.degrees_of_freedom : 0.0,
      report.degrees_of_freedom, Counted(static_cast<std::size_t>(report.poses), "pose"),
      LengthText(report.distance_sigma));
  rows = {{"shape of the volume", "known to [ppm]", "moves its edge by"}};
  for (const calib::WandShape& shape : report.shapes) {
    rows.push_back({shape.name, fmt::format("{:.0f}", 1e6 * shape.sigma), LengthText(shape.moved)});
  }
  return text + AlignedTable(rows) + fmt::format("\n-> {}\n", out);
}

}  // namespace

int RunCalibrateWand(const Common& common, const WandArguments& arguments) {
  data::Provenance provenance = StartProvenance(common);
  provenance.AddInput(arguments.readings);
  provenance.options["bar"] = arguments.bar;
  provenance.options["lens"] = arguments.lens;
  provenance.options["order"] = arguments.order;
  provenance.options["folds"] = std::to_string(arguments.options.folds);
  provenance.seed = arguments.options.fit.guess.seed;
  if (arguments.bar.empty()) {
    throw Error("is needed with --wand", "--bar",
                "give the bar's length and how well it is known, as 0.7501m+-0.1mm");
  }
  const calib::WandBar bar = calib::ParseBar(arguments.bar, "--bar");
  const data::WandReadings readings = data::ReadWand(arguments.readings);
  data::Survey survey;
  if (!arguments.points.empty()) {
    provenance.AddInput(arguments.points);
    survey = data::ReadSurvey(arguments.points);
    measure::FindSurveyReadings(&survey, arguments.options.workers);
  }
  const calib::WandData data =
      calib::MakeWandData(readings, bar, arguments.points.empty() ? nullptr : &survey,
                          arguments.readings, arguments.points);
  calib::WandOptions options = arguments.options;
  options.verdict.need = NeedOption(arguments.need);
  options.frame.cameras = arguments.frame;
  if (!arguments.layout.empty()) {
    provenance.AddInput(arguments.layout);
    options.frame.layout = calib::PlannedPlaces(data::ReadLab(arguments.layout));
  }
  if (!arguments.from.empty()) {
    provenance.AddInput(arguments.from);
    options.fit.from =
        calib::CamerasOf(data::ReadRig(arguments.from), data.cameras, arguments.from);
  }
  if (!arguments.lenses.empty()) {
    provenance.AddInput(arguments.lenses);
    options.fit.lenses = calib::KnownLensesOf(data::ReadRig(arguments.lenses));
  }
  Progress progress("calibrate", !common.quiet && !common.json);
  options.progress = [&](double done) { progress.Update(done); };
  calib::WandCalibration result = calib::CalibrateWand(data, options, arguments.readings);
  if (!arguments.layout.empty()) {
    calib::JudgeLayout(
        data::ReadLab(arguments.layout), &result.rig,
        result.fit.by_points ? calib::ScaleFrom::kBarWithPoints : calib::ScaleFrom::kBar);
  }
  data::WriteRig(arguments.out, result.rig, provenance);
  if (!arguments.report.empty()) {
    WriteCalibrateWandPage(arguments.report, arguments.readings, result, provenance);
  }
  Finish(common, Json(result, arguments), Text(result, arguments.out));
  if (result.rig.verdict != calib::kDoNotUse) return kExitGood;
  const auto& reasons = result.rig.reasons;
  return NotUsable(arguments.readings, "the calibration's verdict is \"" + result.rig.verdict +
                                           "\"" + (reasons.empty() ? "" : ": " + reasons.front()));
}

void AddWandOptions(CLI::App* app, VerbFiles& files, WandArguments* wand) {
  CLI::Option* readings =
      files.Read("--wand", &wand->readings,
                 "Instead of SURVEY: readings of a bar that was moved by hand [CSV, HDF5]");
  app->add_option("--bar", wand->bar,
                  "Its length, as 0.7501m+-0.1mm; of more than two marks their distances from the "
                  "first, as 0.25m,0.75m+-0.1mm")
      ->type_name("LENGTH")
      ->needs(readings);
  files
      .Read("--points", &wand->points,
            "Surveyed points for the frame, three or more, with readings [CSV, HDF5]")
      ->needs(readings);
  files.Read("--from", &wand->from, "A rig of before to start from [HDF5]")->needs(readings);
  CLI::Option* frame =
      app->add_option("--frame", wand->frame,
                      "Three cameras that give the frame: origin, x towards, y towards")
          ->delimiter(',')
          ->expected(3)
          ->type_name("CAMERAS")
          ->needs(readings);
  CLI::Option* plumb =
      app->add_option("--plumb", wand->options.frame.plumb,
                      "The pose in which the bar hung plumb, its first mark above: z is up")
          ->type_name("POSE")
          ->needs(readings)
          ->excludes(frame);
  CLI::Option* origin =
      app->add_option("--origin", wand->options.frame.origin,
                      "With --plumb, the pose whose middle is the origin and whose bearing is x")
          ->type_name("POSE")
          ->needs(plumb);
  plumb->needs(origin);
  // What is said of a survey holds for none of this. (Files of a survey: AddCalibrate refuses them,
  // after outputs were held against inputs.)
  for (const char* name : {"--sigma", "--angle-sigma", "--distance-sigma", "--station",
                           "--distance-error", "--zenith-error"}) {
    readings->excludes(app->get_option(name));
  }
}

}  // namespace unfurl::cli
