#include "data/study.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

namespace unfurl::data {

namespace {

std::string Beside(const std::string& study, const std::string& file) {
  const std::filesystem::path path(file);
  if (path.is_absolute()) return file;
  return (std::filesystem::path(study).parent_path() / path).lexically_normal().string();
}

StudyParameter ReadParameter(const std::string& name, const TomlTable& t) {
  StudyParameter p;
  p.name = name;
  p.where = t.Where();
  p.unit = t.StringOr("unit", "1");
  p.keys = t.Strings("keys");
  if (p.keys.empty()) {
    t.Fail("keys", "a parameter that drives nothing", "name at least one key of the scene");
  }
  p.start = t.Number("start");
  const std::vector<double> bounds = t.Numbers("bounds", 2);
  p.low = bounds[0];
  p.high = bounds[1];
  if (!(p.low < p.high)) {
    t.Fail("bounds", fmt::format("[{}, {}] encloses nothing", p.low, p.high),
           "give [low, high] with low < high");
  }
  if (p.start < p.low || p.start > p.high) {
    t.Fail("start", fmt::format("{} lies outside the bounds [{}, {}]", p.start, p.low, p.high),
           "start within the bounds");
  }
  p.log = t.ChoiceOr("transform", "none", {"none", "log"}) == "log";
  if (p.log && !(p.low > 0.0)) {
    t.Fail("bounds", fmt::format("a logarithm cannot go down to {}", p.low),
           "give a positive lower bound, or transform = \"none\"");
  }
  if (const auto prior = t.TableOrNone("prior")) {
    p.prior = {prior->Number("mean"), prior->Number("sigma", kPositive)};
  }
  return p;
}

StudyTrial ReadTrial(const std::string& study, const TomlTable& t) {
  StudyTrial trial;
  trial.where = t.Where();
  trial.tracks = Beside(study, t.String("tracks"));
  trial.marks = t.StringsOr("marks", {});
  const std::vector<double> window = t.NumbersOr("window", {0.0, 0.0}, 2);
  trial.window_low = window[0];
  trial.window_high = window[1];
  if (t.Has("window") && !(window[0] < window[1])) {
    t.Fail("window", fmt::format("[{}, {}] encloses nothing", window[0], window[1]),
           "give [from, to] on the tracks' clock, in seconds");
  }
  return trial;
}

Study ReadFrom(const TomlTable& root, const std::string& path) {
  Study study;
  study.path = path;
  const TomlTable head = root.Table("study");
  study.name = head.StringOr("name", std::filesystem::path(path).stem().string());
  study.scene = Beside(path, head.String("scene"));
  study.set = head.StringsOr("set", {});
  study.trials.push_back(ReadTrial(path, root.Table("trial")));

  for (const auto& [name, table] : root.NamedTables("parameter")) {
    study.parameters.push_back(ReadParameter(name, table));
  }
  if (study.parameters.empty()) {
    root.Fail("parameter", "a study without parameters", "add a table [parameter.NAME]");
  }
  std::vector<std::pair<std::string, std::string>> driven;
  for (const StudyParameter& p : study.parameters) {
    for (const std::string& key : p.keys) {
      for (const auto& [other, by] : driven) {
        if (other == key) {
          root.Table("parameter")
              .Table(p.name)
              .Fail("keys", fmt::format("{} is driven by {} already", key, by),
                    "let each key of the scene be driven by one parameter");
        }
      }
      driven.emplace_back(key, p.name);
    }
  }

  if (const auto model = root.TableOrNone("model")) {
    study.rtol = model->NumberOr("rtol", study.rtol, {1e-12, 1e-2});
  }
  if (const auto solver = root.TableOrNone("solver")) {
    study.stages = solver->NumbersOr("stages", {}, -1, kPositive);
    if (!std::is_sorted(study.stages.begin(), study.stages.end())) {
      solver->Fail("stages", "the ends do not rise", "list them in order of time, in seconds");
    }
    study.max_iterations = solver->IntegerOr("max_iterations", study.max_iterations, 1, 1000);
  }
  if (const auto mesh = root.TableOrNone("mesh_check")) {
    StudyMeshCheck check;
    check.keys = mesh->Strings("keys");
    check.value = mesh->Number("value", kPositive);
    check.spacing_ratio = mesh->NumberOr("spacing_ratio", 2.0, {1.0, 1e3, true, false});
    check.order = mesh->NumberOr("order", 2.0, kPositive);
    study.mesh_check = check;
  }
  root.RefuseUnknownKeys();
  return study;
}

}  // namespace

Study ReadStudy(const std::string& path, const std::vector<std::string>& overrides) {
  return ReadFrom(LoadToml(path, overrides), path);
}

Study ParseStudy(const std::string& text, const std::string& name) {
  return ReadFrom(ParseToml(text, name), name);
}

}  // namespace unfurl::data
