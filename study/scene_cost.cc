#include "study/scene_cost.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "base/statistics.h"
#include "sim/methods/simulate.h"
#include "sim/model/model.h"

namespace unfurl::study {
namespace {

// The reference's tolerance, of the tightest asked: its own error is then below 1% of any other's.
constexpr double kFiner = 0.01;
// Its mesh, times the finest asked: of second order, so that three quarters of the error show.
constexpr int kFinerMesh = 2;
constexpr double kTightest = 1e-12;  // that rounding lets a run of some 1e5 steps keep [-]
constexpr int kRepeats = 3;          // of a short run: the median is not moved by what else ran

class CostRuns {
 public:
  CostRuns(const data::Scene& scene, const SceneCostOptions& options, double duration,
           const std::function<void(double, const std::string&)>& progress)
      : scene_(scene), options_(options), duration_(duration), progress_(progress) {}

  correlate::CostStudy Run() {
    const std::vector<correlate::CostSetting> settings = Settings();
    total_ = static_cast<double>(settings.size()) + 2.0;
    const correlate::CostSetting finest = Finest(0);
    const correlate::CostRun reference = Measure(finest, 1);
    if (!reference.usable) {
      throw Error(fmt::format("the finest run ({}) fails: {}", finest.Name(), reference.message),
                  scene_.path, "shorten --duration, or try other --methods");
    }
    correlate::CostRun second;
    if (options_.methods.size() > 1) second = Measure(Finest(1), 1);
    std::vector<correlate::CostRun> runs;
    runs.reserve(settings.size());
    for (const correlate::CostSetting& s : settings) runs.push_back(Measure(s, kRepeats));
    return correlate::StudyCost(runs, reference, &second);
  }

 private:
  std::vector<correlate::CostSetting> Settings() const {
    const std::vector<int> meshes =
        options_.segments.empty() ? std::vector<int>{0} : options_.segments;
    std::vector<correlate::CostSetting> settings;
    for (const std::string& method : options_.methods) {
      for (const int mesh : meshes) {
        for (const double rtol : options_.tolerances) settings.push_back({method, rtol, mesh});
      }
    }
    return settings;
  }

  correlate::CostSetting Finest(std::size_t method) const {
    const double tightest =
        *std::min_element(options_.tolerances.begin(), options_.tolerances.end());
    int mesh = 0;
    for (const int n : options_.segments) mesh = std::max(mesh, kFinerMesh * n);
    return {options_.methods[method], std::max(kTightest, kFiner * tightest), mesh};
  }

  sim::Model Compiled(int segments) const {
    data::Scene scene = scene_;
    int changed = 0;
    for (data::SceneBeam& beam : scene.beams) {
      if (segments == 0 || beam.model != data::BeamModel::kSegments) continue;
      beam.segments = segments;
      ++changed;
    }
    if (segments > 0 && changed == 0) {
      throw Error("the scene has no beam of segments", scene.path, "leave --segments out");
    }
    return sim::Compile(scene);
  }

  // A run's tracks; its time is the median of `repeats` where runs are short.
  correlate::CostRun Measure(const correlate::CostSetting& setting, int repeats) {
    if (progress_) progress_(done_++ / total_, setting.Name());
    correlate::CostRun run;
    run.setting = setting;
    const sim::Model model = Compiled(setting.mesh);
    sim::SimulateOptions options;
    options.method = sim::MethodOf(setting.method);
    options.rtol = setting.tolerance;
    options.duration = duration_;
    options.rate = options_.samples / duration_;
    std::vector<double> seconds;
    do {
      const sim::MarkTracks tracks = sim::SimulateMarks(model, options);
      run.usable = tracks.report.Usable();
      run.message = tracks.report.message;
      seconds.push_back(tracks.report.seconds);
      run.x = tracks.x;
      run.y = tracks.y;
    } while (run.usable && seconds.back() < options_.repeat_below &&
             static_cast<int>(seconds.size()) < repeats);
    run.seconds = Median(seconds);
    return run;
  }

  const data::Scene& scene_;
  const SceneCostOptions& options_;
  const double duration_;  // [s]
  const std::function<void(double, const std::string&)>& progress_;
  double done_ = 0.0, total_ = 1.0;  // runs
};

}  // namespace

void SceneCostOptions::Check() const {
  if (methods.empty()) throw Error("no method is given", "option methods", "name one");
  if (tolerances.empty()) throw Error("no tolerance is given", "option rtol", "name one");
  for (const std::string& method : methods) {
    for (const double rtol : tolerances) {
      sim::SimulateOptions run;
      run.method = sim::MethodOf(method);
      run.rtol = rtol;
      run.duration = duration;
      run.Check();
    }
  }
  for (const int n : segments) {
    if (n < 1) throw Error(fmt::format("{} segments", n), "option segments", "use 1 or more");
  }
  if (samples < 2) {
    throw Error(fmt::format("{} samples", samples), "option samples", "use 2 or more");
  }
  if (!(repeat_below >= 0.0)) {
    throw Error(fmt::format("{} s is not a time", repeat_below), "option repeat_below",
                "use 0 s or more");
  }
}

bool SceneCost::Usable() const {
  return std::any_of(study.points.begin(), study.points.end(),
                     [](const correlate::CostPoint& p) { return p.usable; });
}

SceneCost StudySceneCost(const data::Scene& scene, const SceneCostOptions& options,
                         const std::function<void(double, const std::string&)>& progress) {
  options.Check();
  if (scene.marks.empty()) {
    throw Error("the scene has no marks to compare", scene.path, "give it a [mark.NAME]");
  }
  SceneCost cost;
  cost.duration = options.duration > 0.0 ? options.duration : scene.duration;
  cost.study = CostRuns(scene, options, cost.duration, progress).Run();
  return cost;
}

}  // namespace unfurl::study
