// `unfurl cost`: what accuracy costs on a scene, in words and a page.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/progress.h"
#include "base/text.h"
#include "campaign/json_number.h"
#include "cli/cost_page.h"
#include "cli/cost_rig.h"
#include "cli/cost_study.h"
#include "cli/verb.h"
#include "data/formats.h"
#include "data/scene.h"
#include "study/scene_cost.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct CostArguments {
  std::string scene, report;
  std::vector<std::string> sets;
  study::SceneCostOptions cost;
  // Of a study.
  std::string within;
  study::StudyCostOptions study;
  CostRigArguments rig;
};

// Which options of the other kind of input were given; empty: none.
std::string Misplaced(const CLI::App& app, std::initializer_list<const char*> options) {
  for (const char* option : options) {
    if (app.get_option(option)->count() > 0) return option;
  }
  return {};
}

// Whether surveying is asked for. Throws Error for options of another kind, and for no input.
bool IsOfRig(const CLI::App& app, const CostArguments& arguments) {
  const bool rig = arguments.rig.asked();
  if (!rig && arguments.scene.empty()) {
    throw Error("is needed", "INPUT", "give a scene or a study, or --rig or --survey");
  }
  if (rig && !arguments.scene.empty()) {
    throw Error("is given beside --rig or --survey", "INPUT", "leave one of them out");
  }
  // Here and not by the options themselves: outputs are held against all inputs first.
  if (!arguments.rig.rig.empty() && !arguments.rig.survey.empty()) {
    throw Error("is given beside --rig", "--survey", "leave one of them out");
  }
  const std::string misplaced =
      rig ? Misplaced(app, {"--quantity", "--methods", "--rtol", "--segments", "--order",
                            "--duration", "--vary", "--within", "--allow-programs", "--set"})
          : CostRigOptionGiven(app);
  if (misplaced.empty()) return rig;
  throw Error(rig ? "is for a scene or a study" : "is for --rig or --survey", misplaced,
              "leave it out; `unfurl cost --help`");
}

ordered_json LineJson(const study::SceneCost& cost, int k) {
  const study::CostLine& line = cost.lines[static_cast<std::size_t>(k)];
  ordered_json out = {{"name", line.quantity.name},
                      {"unit", line.quantity.unit},
                      {"scale", line.scale},
                      {"settled", line.settled},
                      {"reference_error", campaign::NumberOrNull(line.reference_error)}};
  for (const double target : study::kCostTargets) {
    const study::CostPoint* best = study::Cheapest(cost, target, k);
    out["cheapest"].push_back(
        {{"error", target},
         {"setting", best == nullptr ? ordered_json() : ordered_json(best - cost.points.data())}});
  }
  return out;
}

ordered_json PointJson(const study::SceneCost& cost, const study::CostPoint& p) {
  ordered_json point = {{"method", p.setting.method}, {"rtol", p.setting.tolerance}};
  if (!p.setting.beams.empty()) point["beams"] = p.setting.beams;
  if (p.setting.segments > 0) point["segments"] = p.setting.segments;
  if (p.setting.order > 0) point["order"] = p.setting.order;
  point["set"] = p.setting.set;
  point["usable"] = p.usable;
  if (!p.usable) {
    point["message"] = p.message;
    return point;
  }
  point["seconds"] = p.seconds;
  point["scatter"] = p.scatter;
  point["runs"] = p.runs;
  if (p.worst >= 0) {
    point["worst"] = cost.lines[static_cast<std::size_t>(p.worst)].quantity.name;
    point["rms"] = campaign::NumberOrNull(p.rms);
    point["largest"] = campaign::NumberOrNull(p.largest);
    point["on_front"] = p.on_front;
  }
  for (std::size_t l = 0; l < p.errors.size(); ++l) {
    if (!cost.lines[l].settled) continue;
    point["errors"][cost.lines[l].quantity.name] = {
        {"rms", campaign::NumberOrNull(p.errors[l].rms)},
        {"largest", campaign::NumberOrNull(p.errors[l].largest)},
        {"bound", p.errors[l].bound}};
  }
  return point;
}

ordered_json CostJson(const std::string& scene, const study::SceneCost& cost) {
  ordered_json json = {{"scene", scene},
                       {"duration", cost.duration},
                       {"seconds", cost.seconds},
                       {"reference", cost.reference},
                       {"advice", study::CostAdvice(cost)},
                       {"left_out", cost.left_out},
                       {"absent", cost.absent},
                       {"refused", cost.refused},
                       {"lines", ordered_json::array()},
                       {"settings", ordered_json::array()}};
  for (std::size_t l = 0; l < cost.lines.size(); ++l) {
    json["lines"].push_back(LineJson(cost, static_cast<int>(l)));
  }
  for (const study::CostPoint& p : cost.points) json["settings"].push_back(PointJson(cost, p));
  return json;
}

int RunCost(const Common& common, const CostArguments& arguments) {
  const data::Scene scene = data::ReadScene(arguments.scene, arguments.sets);
  study::SceneCostOptions options = arguments.cost;
  options.workers = arguments.study.workers;
  if (!arguments.within.empty()) options.within = TimeOption(arguments.within);
  study::SceneCost cost;
  {
    Progress progress("cost", !common.quiet);
    cost = study::StudySceneCost(scene, options, [&](double part, const std::string& setting) {
      progress.Update(part, setting);
    });
  }
  if (!cost.problem.empty()) {
    return NotUsable(arguments.scene, cost.problem + "; give --within more");
  }
  ordered_json json = CostJson(arguments.scene, cost);
  std::string text = CostText(arguments.scene, scene.name, cost);
  if (!arguments.report.empty()) {
    data::Provenance provenance = StartProvenance(common);
    for (const std::string& file : scene.files) provenance.AddInput(file);
    WriteCostPage(arguments.report, scene.name, cost, provenance);
    json["report"] = arguments.report;
  }
  Finish(common, json, text);
  return cost.Usable() ? kExitGood
                       : NotUsable(arguments.scene,
                                   "nothing can be said of any setting; the table "
                                   "says why");
}

}  // namespace

Verb AddCost(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(
      program, common, "cost",
      "Run time against accuracy: of a scene, or of a study's intervals; hours of surveying "
      "against accuracy, of a rig",
      "unfurl cost scene.toml --quantity joint1.theta --within 60s --report cost.html\n"
      "  unfurl cost --rig rig.h5 --need 0.5mm --lay-out points.csv");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto arguments = std::make_shared<CostArguments>();
  files.Read("INPUT", &arguments->scene,
             "A scene: tolerances, methods, meshes, models of beams; a study: rungs, tolerance, "
             "horizon, starts, "
             "marks, each fitted (TOML); or --rig or --survey");
  AddCostRigOptions(&verb, &arguments->rig);
  files.Overrides(&arguments->sets, "Overrides a key of the scene or study (repeatable)");
  app->add_option(
         "--quantity", arguments->cost.quantities,
         "Of a scene: what is judged, by name, * and ? standing for letters (repeatable): a "
         "mark, joint1.theta, joint1.latch_time, joint1.peak_moment, EVENT.time, frequency.1 "
         "(default: marks, joints, latch and event times, peak loads)")
      ->delimiter(',')
      ->type_name("NAMES");
  app->add_option("--methods", arguments->cost.methods, "Of a scene: methods to compare")
      ->delimiter(',')
      ->capture_default_str()
      ->type_name("NAMES");
  app->add_option("--rtol", arguments->cost.tolerances,
                  "Of a scene: tolerances (default: from 1e-2 to 1e-6, of beams until the mesh is "
                  "what is left)")
      ->delimiter(',');
  app->add_option("--segments", arguments->cost.segments,
                  "Of a scene: meshes, so many segments for every beam (default, without --order: "
                  "half of the scene's, as many, twice as many)")
      ->delimiter(',');
  app->add_option(
         "--order", arguments->cost.orders,
         "Of a scene: smooth beams with so many shapes (default, without --segments: 1 to 4)")
      ->delimiter(',');
  app->add_option("--duration", arguments->cost.duration,
                  "Of a scene: seconds to simulate (default: its own)");
  app->add_option(
         "--vary", arguments->study.vary,
         "Of a study: what to vary: " + JoinWords(study::StudyCostKinds()) + " (default: all)")
      ->delimiter(',')
      ->type_name("NAMES");
  app->add_option(
         "--within", arguments->within,
         "Of a scene: CPU time that all runs together may take, such as 60s; of a study: begin no "
         "further fit after this time")
      ->type_name("TIME");
  app->add_option("--workers", arguments->study.workers,
                  "Simulations at a time (default: one per core)");
  AddAllowPrograms(app, &arguments->study.allow_programs);
  files.Page(&arguments->report, "Also write a page with pictures (HTML)");
  verb.run = [&common, arguments, app] {
    if (IsOfRig(*app, *arguments)) return RunCostRig(common, arguments->rig, arguments->report);
    const bool study = data::KindOf(arguments->scene) == "study";
    const std::string misplaced = study ? Misplaced(*app, {"--quantity", "--methods", "--rtol",
                                                           "--segments", "--order", "--duration"})
                                        : Misplaced(*app, {"--vary", "--allow-programs"});
    if (!misplaced.empty()) {
      throw Error(study ? "is for a scene, and this is a study"
                        : "is for a study, and this is a "
                          "scene",
                  misplaced, "leave it out; `unfurl cost --help`");
    }
    if (!study) return RunCost(common, *arguments);
    CostStudyArguments of;
    of.study = arguments->scene;
    of.report = arguments->report;
    of.sets = arguments->sets;
    of.within = arguments->within;
    of.cost = arguments->study;
    of.cost.allow_programs = ProgramsAllowed(of.cost.allow_programs);
    return RunCostStudy(common, of);
  };
  return verb;
}

}  // namespace unfurl::cli
