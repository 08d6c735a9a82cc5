// `unfurl cost`: what accuracy costs on a scene, in words and a page.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/progress.h"
#include "base/table.h"
#include "base/text.h"
#include "cli/cost_page.h"
#include "cli/cost_study.h"
#include "cli/verb.h"
#include "data/formats.h"
#include "data/scene.h"
#include "study/scene_cost.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct Arguments {
  std::string scene, report;
  std::vector<std::string> sets;
  study::SceneCostOptions cost;
  // Of a study.
  std::string within;
  study::StudyCostOptions study;
};

// Which options of the other kind of input were given; empty: none.
std::string Misplaced(const CLI::App& app, std::initializer_list<const char*> options) {
  for (const char* option : options) {
    if (app.get_option(option)->count() > 0) return option;
  }
  return {};
}

ordered_json PointJson(const correlate::CostPoint& p) {
  ordered_json point = {{"method", p.setting.method}, {"rtol", p.setting.tolerance}};
  if (p.setting.mesh > 0) point["segments"] = p.setting.mesh;
  point["usable"] = p.usable;
  if (p.usable) {
    point["seconds"] = p.seconds;
    point["rms"] = p.rms;
    point["largest"] = p.largest;
    point["on_front"] = p.on_front;
  } else {
    point["message"] = p.message;
  }
  return point;
}

int Run(const Common& common, const Arguments& arguments) {
  const data::Scene scene = data::ReadScene(arguments.scene, arguments.sets);
  study::SceneCost cost;
  {
    Progress progress("cost", !common.quiet);
    cost = study::StudySceneCost(
        scene, arguments.cost,
        [&](double part, const std::string& setting) { progress.Update(part, setting); });
  }
  const correlate::CostStudy& study = cost.study;
  const std::vector<std::string> advice = correlate::CostAdvice(study);
  ordered_json json = {{"scene", arguments.scene},
                       {"duration", cost.duration},
                       {"reference", study.reference.Name()},
                       {"advice", advice}};
  if (study.floor >= 0.0) json["floor"] = study.floor;
  for (const correlate::CostPoint& p : study.points) json["settings"].push_back(PointJson(p));
  std::string text = fmt::format("{}: {:g} s of \"{}\"; the cheapest setting for an error of\n",
                                 arguments.scene, cost.duration, scene.name);
  for (const std::string& line : advice) text += "  " + line + "\n";
  text += AlignedTable(CostRows(study));
  text += fmt::format(
      "(errors: distance of the worst mark from the reference run, {}, relative to its "
      "range of motion; best: no other setting is both faster and more accurate)\n",
      study.reference.Name());
  if (study.floor >= 0.0) {
    text += fmt::format("the finest run of method {} differs from it by {:.1e}\n",
                        study.second.method, study.floor);
  }
  if (!arguments.report.empty()) {
    data::Provenance provenance = StartProvenance(common);
    for (const std::string& file : scene.files) provenance.AddInput(file);
    WriteCostPage(arguments.report, scene.name, study, provenance);
    json["report"] = arguments.report;
  }
  Finish(common, json, text);
  return cost.Usable() ? kExitGood
                       : NotUsable(arguments.scene, "no run came to its end; the table says why");
}

}  // namespace

Verb AddCost(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(program, common, "cost",
                          "Run time against accuracy: of a scene, or of a study's intervals",
                          "unfurl cost scene.toml --segments 4,8,16 --report cost.html");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto arguments = std::make_shared<Arguments>();
  files
      .Read("INPUT", &arguments->scene,
            "A scene: tolerances, methods, meshes; a study: rungs, tolerance, horizon, starts, "
            "marks, each fitted (TOML)")
      ->required();
  files.Overrides(&arguments->sets, "Overrides a key of the scene or study (repeatable)");
  app->add_option("--methods", arguments->cost.methods,
                  "Of a scene: methods to compare; the first makes the finest run, the second "
                  "checks it")
      ->delimiter(',')
      ->capture_default_str()
      ->type_name("NAMES");
  app->add_option("--rtol", arguments->cost.tolerances, "Of a scene: tolerances")
      ->delimiter(',')
      ->capture_default_str();
  app->add_option("--segments", arguments->cost.segments,
                  "Of a scene: meshes, so many segments for every beam of segments (default: the "
                  "scene's)")
      ->delimiter(',');
  app->add_option("--duration", arguments->cost.duration,
                  "Of a scene: seconds to simulate (default: its own)");
  app->add_option(
         "--vary", arguments->study.vary,
         "Of a study: what to vary: " + JoinWords(study::StudyCostKinds()) + " (default: all)")
      ->delimiter(',')
      ->type_name("NAMES");
  app->add_option("--within", arguments->within,
                  "Of a study: begin no further fit after this time, such as 5min")
      ->type_name("TIME");
  app->add_option("--workers", arguments->study.workers,
                  "Of a study: simulations at a time (default: one per core)");
  AddAllowPrograms(app, &arguments->study.allow_programs);
  files.Page(&arguments->report, "Also write a page with pictures (HTML)");
  verb.run = [&common, arguments, app] {
    const bool study = data::KindOf(arguments->scene) == "study";
    const std::string misplaced =
        study ? Misplaced(*app, {"--methods", "--rtol", "--segments", "--duration"})
              : Misplaced(*app, {"--vary", "--within", "--workers", "--allow-programs"});
    if (!misplaced.empty()) {
      throw Error(study ? "is for a scene, and this is a study"
                        : "is for a study, and this is a "
                          "scene",
                  misplaced, "leave it out; `unfurl cost --help`");
    }
    if (!study) return Run(common, *arguments);
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
