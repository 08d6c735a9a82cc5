#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/length.h"
#include "base/progress.h"
#include "base/table.h"
#include "base/text.h"
#include "calib/calibrate_survey.h"
#include "calib/layout.h"
#include "calib/observations.h"
#include "calib/verdict.h"
#include "cli/calibrate_json.h"
#include "cli/calibrate_page.h"
#include "cli/calibrate_wand.h"
#include "cli/verb.h"
#include "data/lab.h"
#include "data/rig.h"
#include "data/survey.h"
#include "data/survey_points.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct CalibrateArguments {
  std::string survey, readings, layout, lenses, out, report, need;
  std::string lens = "rectilinear", order = "auto";
  data::StationSigmas sigmas;
  std::vector<double> station, distance_error;
  double zenith_error = 0.0;
  calib::CalibrateOptions options;
  WandArguments wand;
  CLI::Option* folds_given = nullptr;
};

std::string Check(const data::Rig& rig, const std::string& name, double scale, int decimals) {
  const auto found = rig.checks.find(name);
  if (found == rig.checks.end()) return "-";
  return fmt::format("{:.{}f}", scale * found->second, decimals);
}

std::string WithUnit(double value, const std::string& unit) {
  if (unit == "m") return LengthText(value);
  if (unit == "rad") return fmt::format("{:.2g} mrad", 1e3 * value);
  return fmt::format("{:.2g} {}", value, unit);
}

std::string CameraTable(const calib::Calibration& result) {
  std::vector<std::vector<std::string>> rows = {{"camera", "f [px]", "u0 [px]", "x [m]", "y [m]",
                                                 "z [m]", "readings", "residual [px]", "floor [px]",
                                                 "gross"}};
  for (std::size_t j = 0; j < result.rig.cameras.size(); ++j) {
    const data::RigCamera& camera = result.rig.cameras[j];
    const calib::CameraReport& fit = result.report.cameras[j];
    rows.push_back({camera.name, fmt::format("{:.2f}", camera.f_px),
                    fmt::format("{:.2f}", camera.u0_px), fmt::format("{:.4f}", camera.p_WC.x()),
                    fmt::format("{:.4f}", camera.p_WC.y()), fmt::format("{:.4f}", camera.p_WC.z()),
                    fmt::format("{}", fit.readings), fmt::format("{:.4f}", fit.residual_rms_px),
                    fmt::format("{:.4f}", fit.floor_px), fmt::format("{}", fit.gross)});
  }
  return AlignedTable(rows);
}

std::string HeldOutTable(const data::Rig& rig) {
  const auto rms = rig.checks.find("held_out_rms [m]");
  const LengthUnit unit = UnitFor(rms != rig.checks.end() ? rms->second : 1e-3);
  const auto length = [&](const char* name) {
    return Check(rig, std::string(name) + " [m]", unit.per_metre, 3);
  };
  return AlignedTable(
      {{"held-out points", fmt::format("error [{}]", unit.name),
        fmt::format("predicted [{}]", unit.name)},
       {"RMS from the survey", length("held_out_rms"), length("held_out_rms_predicted")},
       {"RMS without the survey's error", length("own_error_rms"),
        length("own_error_rms_predicted")},
       {"  upper bound (95%)", length("own_error_rms_at_most"), ""},
       {"95% within", length("held_out_p95"), ""},
       {"largest", length("held_out_max"), ""}});
}

std::string WeakText(const calib::Calibration& result) {
  std::string text;
  for (const calib::WeakDirection& weak : result.report.weak) {
    text += fmt::format("  camera {}, {}: sigma {}; {}\n",
                        result.rig.cameras[static_cast<std::size_t>(weak.camera)].name, weak.name,
                        WithUnit(weak.sigma, weak.unit),
                        weak.harmless ? "this does not affect reconstruction"
                                      : fmt::format("moves found points by {}: {}",
                                                    LengthText(weak.point_rms), weak.advice));
  }
  return text.empty() ? text : "\nPoorly determined by this survey:\n" + text;
}

std::string OrderText(const calib::CalibrationReport& report) {
  std::string text = fmt::format("\nLens model: {}", report.lens_model);
  if (report.orders.empty()) return text + "\n";
  std::vector<std::vector<std::string>> rows = {
      {"order", "log likelihood lost [nats]", "misclosure [px]", "floor [px]"}};
  for (const calib::OrderTrial& trial : report.orders) {
    rows.push_back({calib::OrderName(trial), fmt::format("{:.1f}", trial.loss),
                    fmt::format("{:.4f}", trial.contradiction_px),
                    fmt::format("{:.4f}", trial.largest_floor_px)});
  }
  return text + ", by cross-validation\n" + AlignedTable(rows);
}

std::string Text(const calib::Calibration& result, const std::string& out) {
  std::string text = fmt::format("Verdict: {}\n", result.rig.verdict);
  for (const std::string& reason : result.rig.reasons) text += "  - " + reason + "\n";
  text += "\n" + CameraTable(result);
  text += fmt::format(
      "  chi-square per degree of freedom {:.3f} ({:.0f} degrees); survey's standard deviations "
      "scaled by {:.2f}\n\n",
      result.report.degrees_of_freedom > 0.0
          ? result.report.chi_square / result.report.degrees_of_freedom
          : 0.0,
      result.report.degrees_of_freedom, result.report.survey_factor);
  return text + HeldOutTable(result.rig) + OrderText(result.report) + WeakText(result) +
         fmt::format("\n-> {}\n", out);
}

data::LensModel LensOf(const std::string& name) {
  if (const auto lens = data::FindLensModel(name)) return *lens;
  std::vector<std::string> known;
  known.reserve(std::size(data::kLensModels));
  for (const data::LensNames& lens : data::kLensModels) known.emplace_back(lens.name);
  throw Error(fmt::format("there is no lens model \"{}\"", name), "--lens",
              "give one of " + JoinWords(known));
}

int OrderOf(data::LensModel lens, const std::string& name) {
  if (name == "auto") return calib::kAutomaticOrder;
  std::vector<std::string> known = {"auto"};
  const auto orders = measure::OrdersOf(lens);
  for (std::size_t k = 0; k < orders.size(); ++k) {
    if (name == orders[k].name) return static_cast<int>(k);
    known.emplace_back(orders[k].name);
  }
  throw Error(fmt::format("the {} lens has no set of terms \"{}\"", data::NamesOf(lens).name, name),
              "--order", "give one of " + JoinWords(known));
}

constexpr char kNotHanded[] =
    "Whether x, y, z are right-handed no readings tell: name the columns E, N, H, or give where "
    "the "
    "cameras were meant to stand (--layout)\n";

int RunCalibrate(const Common& common, const CalibrateArguments& arguments) {
  data::Provenance provenance = StartProvenance(common);
  provenance.AddInput(arguments.survey);
  provenance.options["folds"] = std::to_string(arguments.options.folds);
  provenance.options["e"] = fmt::format("{}", arguments.options.guess.e_mean);
  provenance.options["e_sigma"] = fmt::format("{}", arguments.options.guess.e_sigma);
  provenance.options["lens"] = arguments.lens;
  provenance.options["order"] = arguments.order;
  provenance.seed = arguments.options.guess.seed;

  data::Survey survey =
      data::ReadSurveyInParts(arguments.survey, arguments.readings, arguments.sigmas);
  if (!arguments.readings.empty()) provenance.AddInput(arguments.readings);
  if (!arguments.layout.empty()) provenance.AddInput(arguments.layout);
  if (arguments.station.size() == 3) {
    survey.station = Eigen::Vector3d::Map(arguments.station.data());
  }
  if (arguments.distance_error.size() == 2) {
    survey.station_errors.distance_offset = arguments.distance_error[0];
    survey.station_errors.distance_scale = arguments.distance_error[1];
  }
  if (arguments.zenith_error > 0.0) survey.station_errors.zenith = arguments.zenith_error;
  const bool handed = !arguments.layout.empty() || data::TellsHandedness(arguments.survey);
  calib::CalibrateOptions options = arguments.options;
  options.verdict.need = NeedOption(arguments.need);
  if (!arguments.lenses.empty()) {
    provenance.AddInput(arguments.lenses);
    options.guess.known = calib::KnownLensesOf(data::ReadRig(arguments.lenses));
  }
  Progress progress("calibrate", !common.quiet && !common.json);
  options.progress = [&](double done) { progress.Update(done); };
  calib::Observations data;
  calib::Calibration result = calib::Calibrate(std::move(survey), options, arguments.survey, &data);
  if (!arguments.layout.empty()) {
    calib::JudgeLayout(data::ReadLab(arguments.layout), &result.rig);
  }
  data::WriteRig(arguments.out, result.rig, provenance);
  if (!arguments.report.empty()) {
    WriteCalibratePage(arguments.report, arguments.survey, data, result, provenance);
  }
  ordered_json summary = CalibrationJson(result, arguments.survey, arguments.out);
  summary["right_handed"] = handed ? "told" : "not told";
  Finish(common, summary, Text(result, arguments.out) + (handed ? "" : kNotHanded));
  if (result.rig.verdict != calib::kDoNotUse) return kExitGood;
  const auto& reasons = result.rig.reasons;
  return NotUsable(arguments.survey, "the calibration's verdict is \"" + result.rig.verdict + "\"" +
                                         (reasons.empty() ? "" : ": " + reasons.front()));
}

// Without a survey: what else was given holds for the bar, too.
int RunWand(const Common& common, const CalibrateArguments& arguments) {
  WandArguments wand = arguments.wand;
  wand.layout = arguments.layout;
  wand.lenses = arguments.lenses;
  wand.need = arguments.need;
  wand.out = arguments.out;
  wand.report = arguments.report;
  wand.options.workers = arguments.options.workers;
  if (arguments.folds_given->count() > 0) {
    wand.options.folds = arguments.options.folds;
  }
  wand.options.fit.guess = arguments.options.guess;
  wand.options.fit.guess.lens = LensOf(arguments.lens);
  wand.options.fit.order = OrderOf(wand.options.fit.guess.lens, arguments.order);
  wand.order = arguments.order;
  wand.lens = arguments.lens;
  return RunCalibrateWand(common, wand);
}

}  // namespace

Verb AddCalibrate(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(program, common, "calibrate",
                          "A rig of cameras from a survey, without an initial guess",
                          "unfurl calibrate survey.h5 -o rig.h5\n"
                          "  unfurl calibrate --wand wand.csv --bar 0.7501m+-0.1mm");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto arguments = std::make_shared<CalibrateArguments>();
  files.Read("SURVEY", &arguments->survey,
             "Surveyed points with readings (.csv, .h5) or raw lines (.h5); a column set_up names "
             "the station's set-up of each point");
  files.WriteOr(
      "-o,--output", &arguments->out,
      [arguments] {
        const bool wand = !arguments->wand.readings.empty();
        return DefaultOutput(wand ? arguments->wand.readings : arguments->survey, ".rig.h5");
      },
      "The rig to write (default: SURVEY or READINGS with .rig.h5)");
  files.Page(&arguments->report,
             "A page: verdict, residuals, gross errors, map of uncertainty [HTML]");
  files.Read("--readings", &arguments->readings,
             "Readings by id, where SURVEY holds points only [CSV]; repeats are averaged");
  app->add_option("--sigma", arguments->sigmas.coordinate,
                  "Standard deviation of a point per axis, where SURVEY states none [m]")
      ->check(CLI::PositiveNumber);
  app->add_option("--angle-sigma", arguments->sigmas.angle,
                  "Standard deviation of a GSI file's angles [rad]")
      ->check(CLI::PositiveNumber);
  app->add_option("--distance-sigma", arguments->sigmas.distance,
                  "Standard deviation of a GSI file's distances [m]")
      ->check(CLI::PositiveNumber);
  app->add_option("--station", arguments->station,
                  "Position of the total station, x y z, in the survey's frame [m]")
      ->expected(3);
  app->add_option("--distance-error", arguments->distance_error,
                  "Standard deviations of the distance meter's offset [m] and scale [1], as "
                  "1e-3 1.5e-6 for 1 mm + 1.5 ppm; needs --station")
      ->expected(2)
      ->check(CLI::NonNegativeNumber);
  app->add_option("--zenith-error", arguments->zenith_error,
                  "Standard deviation of the vertical circle's index error [rad]")
      ->check(CLI::PositiveNumber);
  files.Read("--layout", &arguments->layout,
             "Planned camera positions [lab TOML]; detects a left-handed survey");
  CLI::Option* lenses = files.Read("--lenses", &arguments->lenses,
                                   "A rig of the same cameras, calibrated before they were moved: "
                                   "their lenses are known from it, "
                                   "and 8 points do, or a shorter wave of the bar [HDF5]");
  app->add_flag("--steady", arguments->options.trends.steady,
                "Station and cameras did not move during the survey, as a back sight and a mark "
                "that stays show: points may then be measured in the order of their places");
  AddNeedOption(app, &arguments->need);
  arguments->folds_given =
      app->add_option("--folds", arguments->options.folds, "Folds of the cross-validation")
          ->capture_default_str()
          ->check(CLI::Range(2, 1000));
  app->add_option("--lens", arguments->lens, "Lens model: rectilinear, or fisheye (wide angle)")
      ->excludes(lenses)
      ->type_name("MODEL")
      ->capture_default_str()
      ->type_name("LENS");
  app->add_option("--order", arguments->order,
                  "Terms of the lens model: auto (by cross-validation; with --wand the usual set); "
                  "rectilinear: pinhole, "
                  "cubic, cubic-even, quintic, quintic-even, full, septic; fisheye: "
                  "equidistant, two-parameter, full, septic")
      ->excludes(lenses)
      ->capture_default_str()
      ->type_name("ORDER");
  auto* e =
      app->add_option("--e", arguments->options.guess.e_mean,
                      "Prior mean of the distance between a lens' two centres [m]; default: its "
                      "focal length where the pixels' pitch is known, else 1% of the "
                      "distance to the points, give or take 10%");
  app->add_option("--e-sigma", arguments->options.guess.e_sigma, "Its standard deviation [m]")
      ->check(CLI::PositiveNumber)
      ->needs(e);
  e->needs("--e-sigma");
  e->excludes(lenses);
  app->add_option("--seed", arguments->options.guess.seed,
                  "Random seed of the search for gross errors")
      ->capture_default_str();
  app->add_option("--workers", arguments->options.workers, "Threads; 0: all cores")
      ->capture_default_str();
  AddWandOptions(app, files, &arguments->wand);
  verb.run = [&common, arguments] {
    if (!arguments->wand.readings.empty()) {
      if (arguments->options.trends.steady) {
        throw Error("is given beside --wand", "--steady",
                    "nothing asks a bar's poses for their order: leave it out");
      }
      const bool survey = !arguments->survey.empty();
      if (!survey && arguments->readings.empty()) return RunWand(common, *arguments);
      throw Error("is given beside --wand", survey ? "SURVEY" : "--readings",
                  "give surveyed points for the frame by --points, or leave one of the two out");
    }
    if (arguments->survey.empty()) {
      throw Error("is missing", "SURVEY", "give a survey, or readings of a bar by --wand");
    }
    arguments->options.guess.lens = LensOf(arguments->lens);
    arguments->options.order = OrderOf(arguments->options.guess.lens, arguments->order);
    return RunCalibrate(common, *arguments);
  };
  return verb;
}

}  // namespace unfurl::cli
