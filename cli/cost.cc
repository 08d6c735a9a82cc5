// `unfurl cost`: correlate's study of cost, bound to the simulator and a scene.
#include "correlate/fit/cost.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/progress.h"
#include "base/statistics.h"
#include "base/table.h"
#include "cli/cost_page.h"
#include "cli/verb.h"
#include "data/scene.h"
#include "sim/methods/simulate.h"

namespace unfurl::cli {

namespace {

using nlohmann::ordered_json;

constexpr double kSamples = 2000.0;   // that a run is compared on
constexpr double kFiner = 0.01;       // the reference's tolerance, of the tightest asked
constexpr int kFinerMesh = 2;         // times the finest mesh asked, so that its own error shows
constexpr double kTightest = 1e-12;   // that a run can keep
constexpr double kRepeatBelow = 1.0;  // [s]; shorter runs are timed three times

struct Arguments {
  std::string scene, report;
  std::vector<std::string> sets;
  std::vector<std::string> methods = {"projected", "partitioned"};
  std::vector<double> tolerances = {1e-3, 1e-4, 1e-5, 1e-6, 1e-7};
  std::vector<int> segments;
  double duration = 0.0;
};

class CostVerb {
 public:
  CostVerb(const Common& common, const Arguments& arguments)
      : common_(common), arguments_(arguments), progress_("cost", !common.quiet) {}

  int Run() {
    for (const std::string& method : arguments_.methods) sim::MethodOf(method);
    for (const int n : arguments_.segments) {
      if (n < 1) throw Error(fmt::format("{} segments", n), "option segments", "use 1 or more");
    }
    const sim::Model model = Compiled(0);
    if (model.marks.empty()) {
      throw Error("the scene has no marks to compare", arguments_.scene, "give it a [mark.NAME]");
    }
    duration_ = arguments_.duration > 0.0 ? arguments_.duration : model.duration;
    std::vector<correlate::CostSetting> settings = Settings();
    for (const correlate::CostSetting& s : settings) Options(s).Check();

    const int finest = arguments_.segments.empty()
                           ? 0
                           : kFinerMesh * *std::max_element(arguments_.segments.begin(),
                                                            arguments_.segments.end());
    const double tight = std::max(
        kTightest,
        kFiner * *std::min_element(arguments_.tolerances.begin(), arguments_.tolerances.end()));
    total_ = static_cast<double>(settings.size()) + 2.0;
    const correlate::CostRun reference = Measure({arguments_.methods.front(), tight, finest}, 1);
    if (!reference.usable) {
      throw Error(
          fmt::format("the finest run ({}) fails: {}", reference.setting.Name(), reference.message),
          arguments_.scene, "shorten --duration, or try other --methods");
    }
    correlate::CostRun second;
    if (arguments_.methods.size() > 1) {
      second = Measure({arguments_.methods[1], tight, finest}, 1);
    }
    std::vector<correlate::CostRun> runs;
    for (const correlate::CostSetting& s : settings) runs.push_back(Measure(s, 3));
    const correlate::CostStudy study = correlate::StudyCost(runs, reference, &second);
    return Summarize(study, model.name);
  }

 private:
  std::vector<correlate::CostSetting> Settings() const {
    std::vector<int> meshes = arguments_.segments;
    if (meshes.empty()) meshes.push_back(0);
    std::vector<correlate::CostSetting> settings;
    for (const std::string& method : arguments_.methods) {
      for (const int mesh : meshes) {
        for (const double tolerance : arguments_.tolerances) {
          settings.push_back({method, tolerance, mesh});
        }
      }
    }
    return settings;
  }

  sim::Model Compiled(int segments) const {
    std::vector<std::string> sets = arguments_.sets;
    if (segments > 0) {
      const data::Scene scene = data::ReadScene(arguments_.scene, sets);
      int changed = 0;
      for (const data::SceneBeam& beam : scene.beams) {
        if (beam.model != data::BeamModel::kSegments) continue;
        sets.push_back(fmt::format("beam.{}.segments={}", beam.name, segments));
        ++changed;
      }
      if (changed == 0) {
        throw Error("the scene has no beam of segments", arguments_.scene, "leave --segments out");
      }
    }
    return sim::Compile(data::ReadScene(arguments_.scene, sets));
  }

  sim::SimulateOptions Options(const correlate::CostSetting& setting) const {
    sim::SimulateOptions options;
    options.method = sim::MethodOf(setting.method);
    options.rtol = setting.tolerance;
    options.duration = duration_;
    options.rate = kSamples / duration_;
    return options;
  }

  // A run's tracks; its time is the median of `repeats` where runs are short.
  correlate::CostRun Measure(const correlate::CostSetting& setting, int repeats) {
    progress_.Update(done_++ / total_, setting.Name());
    correlate::CostRun run;
    run.setting = setting;
    const sim::Model model = Compiled(setting.mesh);
    std::vector<double> seconds;
    do {
      const sim::MarkTracks tracks = sim::SimulateMarks(model, Options(setting));
      run.usable = tracks.report.Usable();
      run.message = tracks.report.message;
      seconds.push_back(tracks.report.seconds);
      run.x = tracks.x;
      run.y = tracks.y;
    } while (run.usable && seconds.back() < kRepeatBelow &&
             static_cast<int>(seconds.size()) < repeats);
    run.seconds = Median(seconds);
    return run;
  }

  int Summarize(const correlate::CostStudy& study, const std::string& name) const {
    const std::vector<std::string> advice = correlate::CostAdvice(study);
    ordered_json json = {{"scene", arguments_.scene},
                         {"duration", duration_},
                         {"reference", study.reference.Name()},
                         {"advice", advice}};
    if (study.floor >= 0.0) json["floor"] = study.floor;
    bool any = false;
    for (const correlate::CostPoint& p : study.points) {
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
      json["settings"].push_back(point);
      any = any || p.usable;
    }
    std::string text = fmt::format("{}: {:g} s of \"{}\"; the cheapest setting for an error of\n",
                                   arguments_.scene, duration_, name);
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
    if (!arguments_.report.empty()) {
      data::Provenance provenance = StartProvenance(common_);
      const data::Scene scene = data::ReadScene(arguments_.scene, arguments_.sets);
      for (const std::string& file : scene.files) provenance.AddInput(file);
      WriteCostPage(arguments_.report, name, study, provenance);
      json["report"] = arguments_.report;
    }
    Finish(common_, json, text);
    return any ? kExitGood
               : NotUsable(arguments_.scene, "no run came to its end; the table says why");
  }

  const Common& common_;
  const Arguments& arguments_;
  Progress progress_;
  double duration_ = 0.0, done_ = 0.0, total_ = 1.0;
};

}  // namespace

Verb AddCost(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(program, common, "cost",
                          "What accuracy costs in time on a scene: tolerances, methods, meshes",
                          "unfurl cost scene.toml --segments 4,8,16 --report cost.html");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto arguments = std::make_shared<Arguments>();
  files.Read("SCENE", &arguments->scene, "The scene (TOML)")->required();
  files.Overrides(&arguments->sets, "Overrides a key of the scene (repeatable)");
  app->add_option("--methods", arguments->methods,
                  "Methods to compare; the first makes the finest run, the second checks it")
      ->delimiter(',')
      ->capture_default_str()
      ->type_name("NAMES");
  app->add_option("--rtol", arguments->tolerances, "Tolerances")
      ->delimiter(',')
      ->capture_default_str();
  app->add_option("--segments", arguments->segments,
                  "Meshes: so many segments for every beam of segments (default: the scene's)")
      ->delimiter(',');
  app->add_option("--duration", arguments->duration, "Seconds to simulate (default: the scene's)");
  files.Write("--report", &arguments->report, "Also write a page with pictures (HTML)");
  verb.run = [&common, arguments] { return CostVerb(common, *arguments).Run(); };
  return verb;
}

}  // namespace unfurl::cli
