// `unfurl cost`: what accuracy costs on a scene, in words and a page.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/progress.h"
#include "base/table.h"
#include "cli/cost_page.h"
#include "cli/verb.h"
#include "data/scene.h"
#include "study/scene_cost.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

struct Arguments {
  std::string scene, report;
  std::vector<std::string> sets;
  study::SceneCostOptions cost;
};

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
                          "Run time against accuracy on a scene: tolerances, methods, meshes",
                          "unfurl cost scene.toml --segments 4,8,16 --report cost.html");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto arguments = std::make_shared<Arguments>();
  files.Read("SCENE", &arguments->scene, "The scene (TOML)")->required();
  files.Overrides(&arguments->sets, "Overrides a key of the scene (repeatable)");
  app->add_option("--methods", arguments->cost.methods,
                  "Methods to compare; the first makes the finest run, the second checks it")
      ->delimiter(',')
      ->capture_default_str()
      ->type_name("NAMES");
  app->add_option("--rtol", arguments->cost.tolerances, "Tolerances")
      ->delimiter(',')
      ->capture_default_str();
  app->add_option("--segments", arguments->cost.segments,
                  "Meshes: so many segments for every beam of segments (default: the scene's)")
      ->delimiter(',');
  app->add_option("--duration", arguments->cost.duration,
                  "Seconds to simulate (default: the scene's)");
  files.Write("--report", &arguments->report, "Also write a page with pictures (HTML)");
  verb.run = [&common, arguments] { return Run(common, *arguments); };
  return verb;
}

}  // namespace unfurl::cli
