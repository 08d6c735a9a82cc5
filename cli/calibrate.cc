#include "calib/calibrate.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/text.h"
#include "calib/observations.h"
#include "calib/verdict.h"
#include "cli/verb.h"
#include "data/rig.h"
#include "data/survey.h"
#include "measure/survey_readings.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct Arguments {
  std::string survey, out;
  std::string order = "auto";
  calib::CalibrateOptions options;
};

double Sigma(const Eigen::MatrixXd& covariance, std::size_t camera, int parameter) {
  const auto at = static_cast<Eigen::Index>(camera) * data::kCameraParameters + parameter;
  return std::sqrt(covariance(at, at));
}

std::string Check(const data::Rig& rig, const std::string& name, double scale, int decimals) {
  const auto found = rig.checks.find(name);
  if (found == rig.checks.end()) return "-";
  return fmt::format("{:.{}f}", scale * found->second, decimals);
}

std::string WithUnit(double value, const std::string& unit) {
  if (unit == "m") return fmt::format("{:.2g} mm", 1e3 * value);
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
  const auto mm = [&](const char* name) { return Check(rig, std::string(name) + " [m]", 1e3, 3); };
  return AlignedTable(
      {{"held-out points", "found [mm]", "predicted [mm]"},
       {"RMS from the survey", mm("held_out_rms"), mm("held_out_rms_predicted")},
       {"RMS without the survey's error", mm("own_error_rms"), mm("own_error_rms_predicted")},
       {"  which is at most (95%)", mm("own_error_rms_at_most"), ""},
       {"95% within", mm("held_out_p95"), ""},
       {"largest", mm("held_out_max"), ""}});
}

std::string WeakText(const calib::Calibration& result) {
  std::string text;
  for (const calib::WeakDirection& weak : result.report.weak) {
    text += fmt::format("  camera {}, {}: sigma {}; {}\n",
                        result.rig.cameras[static_cast<std::size_t>(weak.camera)].name, weak.name,
                        WithUnit(weak.sigma, weak.unit),
                        weak.harmless ? "this does not harm reconstruction"
                                      : fmt::format("moves found points by {:.2g} mm: {}",
                                                    1e3 * weak.point_rms, weak.advice));
  }
  return text.empty() ? text : "\nBarely determined by this survey:\n" + text;
}

std::string OrderText(const calib::CalibrationReport& report) {
  std::string text = fmt::format("\nLens model: {}",
                                 calib::kLensOrders[static_cast<std::size_t>(report.order)].name);
  if (report.orders.empty()) return text + "\n";
  std::vector<std::vector<std::string>> rows = {
      {"order", "left-out data less likely by [nats]", "contradiction [px]", "floor [px]"}};
  for (const calib::OrderTrial& trial : report.orders) {
    rows.push_back({calib::kLensOrders[static_cast<std::size_t>(trial.order)].name,
                    fmt::format("{:.1f}", trial.loss),
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
      "  chi-square per degree of freedom {:.3f} ({:.0f}); survey's sigmas times {:.2f}\n\n",
      result.report.degrees_of_freedom > 0.0
          ? result.report.chi_square / result.report.degrees_of_freedom
          : 0.0,
      result.report.degrees_of_freedom, result.report.survey_factor);
  return text + HeldOutTable(result.rig) + OrderText(result.report) + WeakText(result) +
         fmt::format("\n-> {}\n", out);
}

ordered_json Json(const calib::Calibration& result, const Arguments& arguments) {
  ordered_json summary = {{"survey", arguments.survey},
                          {"rig", arguments.out},
                          {"verdict", result.rig.verdict},
                          {"reasons", result.rig.reasons},
                          {"model_floor_px", result.rig.model_floor_px}};
  for (std::size_t j = 0; j < result.rig.cameras.size(); ++j) {
    const data::RigCamera& camera = result.rig.cameras[j];
    const calib::CameraReport& fit = result.report.cameras[j];
    summary["cameras"].push_back({{"name", camera.name},
                                  {"position", {camera.p_WC.x(), camera.p_WC.y(), camera.p_WC.z()}},
                                  {"f_px", camera.f_px},
                                  {"f_sigma_px", Sigma(result.rig.covariance, j, 6)},
                                  {"u0_px", camera.u0_px},
                                  {"e", camera.e},
                                  {"e_sigma", Sigma(result.rig.covariance, j, 8)},
                                  {"terms_px", camera.terms_px},
                                  {"readings", fit.readings},
                                  {"gross", fit.gross},
                                  {"floor_px", fit.floor_px},
                                  {"residual_rms_px", fit.residual_rms_px}});
  }
  for (const auto& [name, value] : result.rig.checks) summary["checks"][name] = value;
  summary["lens_model"] = calib::kLensOrders[static_cast<std::size_t>(result.report.order)].name;
  summary["survey_factor"] = result.report.survey_factor;
  summary["orders"] = ordered_json::array();
  for (const calib::OrderTrial& trial : result.report.orders) {
    summary["orders"].push_back(
        {{"name", calib::kLensOrders[static_cast<std::size_t>(trial.order)].name},
         {"loss_nats", trial.loss},
         {"contradiction_px", trial.contradiction_px},
         {"held_out_rms", trial.held_out_rms},
         {"floor_px", trial.largest_floor_px}});
  }
  summary["gross"] = ordered_json::array();
  for (const calib::GrossFinding& finding : result.report.gross) {
    ordered_json points = ordered_json::array();
    for (const int i : finding.points) {
      points.push_back(result.report.ids[static_cast<std::size_t>(i)]);
    }
    summary["gross"].push_back({{"kind", calib::Name(finding.kind)},
                                {"points", points},
                                {"size", finding.size},
                                {"sure", finding.sure},
                                {"text", finding.text}});
    if (finding.camera >= 0) {
      summary["gross"].back()["camera"] =
          result.rig.cameras[static_cast<std::size_t>(finding.camera)].name;
    }
  }
  summary["weak"] = ordered_json::array();
  for (const calib::WeakDirection& weak : result.report.weak) {
    summary["weak"].push_back(
        {{"camera", result.rig.cameras[static_cast<std::size_t>(weak.camera)].name},
         {"direction", weak.name},
         {"unit", weak.unit},
         {"sigma", weak.sigma},
         {"by_prior", weak.by_prior},
         {"point_rms", weak.point_rms},
         {"harmless", weak.harmless},
         {"advice", weak.advice}});
  }
  summary["advice"] = result.report.advice;
  return summary;
}

int OrderOf(const std::string& name) {
  if (name == "auto") return calib::kAutomaticOrder;
  std::vector<std::string> known = {"auto"};
  for (std::size_t k = 0; k < calib::kLensOrders.size(); ++k) {
    if (name == calib::kLensOrders[k].name) return static_cast<int>(k);
    known.emplace_back(calib::kLensOrders[k].name);
  }
  throw Error(fmt::format("there is no lens model \"{}\"", name), "--order",
              "give one of " + JoinWords(known));
}

int RunCalibrate(const Common& common, const Arguments& arguments) {
  data::Provenance provenance = StartProvenance(common);
  provenance.AddInput(arguments.survey);
  provenance.options["folds"] = std::to_string(arguments.options.folds);
  provenance.options["e"] = fmt::format("{}", arguments.options.guess.e_mean);
  provenance.options["e_sigma"] = fmt::format("{}", arguments.options.guess.e_sigma);
  provenance.options["order"] = arguments.order;
  provenance.seed = arguments.options.guess.seed;

  data::Survey survey = data::ReadSurvey(arguments.survey);
  measure::FindSurveyReadings(&survey, arguments.options.workers);
  const calib::Calibration result = calib::Calibrate(calib::FromSurvey(survey, arguments.survey),
                                                     arguments.options, arguments.survey);
  data::WriteRig(arguments.out, result.rig, provenance);
  Finish(common, Json(result, arguments), Text(result, arguments.out));
  return result.rig.verdict == calib::kDoNotUse ? kExitNotUsable : kExitGood;
}

}  // namespace

Verb AddCalibrate(CLI::App& program, Common& common) {
  CLI::App* app = DeclareVerb(program, common, "calibrate",
                              "A rig of cameras from a survey, without an initial guess",
                              "unfurl calibrate survey.h5 -o rig.h5");
  auto arguments = std::make_shared<Arguments>();
  app->add_option("SURVEY", arguments->survey,
                  "Surveyed points with readings (.csv, .h5) or raw lines (.h5)")
      ->required();
  app->add_option("-o,--output", arguments->out, "The rig to write; SURVEY with .rig.h5 if absent");
  app->add_option("--folds", arguments->options.folds,
                  "Parts of the survey that are held out in turn")
      ->capture_default_str()
      ->check(CLI::Range(2, 1000));
  app->add_option("--order", arguments->order,
                  "Terms of the lens model: auto (by cross-validation), pinhole, cubic, "
                  "cubic-even, quintic, quintic-even, full")
      ->capture_default_str();
  app->add_option("--e", arguments->options.guess.e_mean,
                  "What the distance between a lens' two centres is thought to be [m]")
      ->capture_default_str();
  app->add_option("--e-sigma", arguments->options.guess.e_sigma, "and how surely [m]")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  app->add_option("--seed", arguments->options.guess.seed,
                  "Of the random subsets that find gross errors")
      ->capture_default_str();
  app->add_option("--workers", arguments->options.workers, "Threads; 0: all cores")
      ->capture_default_str();
  return {app, [&common, arguments] {
            if (arguments->out.empty()) {
              arguments->out = DefaultOutput(arguments->survey, ".rig.h5");
            }
            arguments->options.order = OrderOf(arguments->order);
            return RunCalibrate(common, *arguments);
          }};
}

}  // namespace unfurl::cli
