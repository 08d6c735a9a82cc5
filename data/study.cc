#include "data/study.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "data/beside.h"
#include "data/scene.h"
#include "data/study_instrument.h"
#include "data/toml_kind.h"

namespace unfurl::data {

namespace {

StudyParameter ReadParameter(const std::string& name, const TomlTable& t, bool command) {
  StudyParameter p;
  p.name = name;
  p.where = t.Where();
  p.unit = t.StringOr("unit", "1");
  // A program takes its parameters by name.
  p.keys = command ? t.StringsOr("keys", {name}) : t.Strings("keys");
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
  if (p.log && p.low < 0.0) {
    t.Fail("bounds", fmt::format("a logarithm cannot go down to {}", p.low),
           "give a lower bound of 0 or more, or transform = \"none\"");
  }
  if (p.log && !(p.start > 0.0)) {
    t.Fail("start", fmt::format("a logarithm cannot begin at {}", p.start),
           "give a positive start, or transform = \"none\"");
  }
  if (const auto prior = t.TableOrNone("prior")) {
    p.prior = {prior->Number("mean"), prior->Number("sigma", kPositive)};
  }
  return p;
}

using StudyKnowledge = StudyKnowledge::Kind;

// "free", "known" (the tracks' is the scene's), or a table; without sigmas it is known.
StudyFrame ReadFrame(const TomlTable& t) {
  StudyFrame out;
  if (!t.Has("frame")) return out;
  if (!t.IsTable("frame")) {
    out.kind = t.Choice("frame", {"free", "known"}) == "free" ? StudyKnowledge::kFree
                                                              : StudyKnowledge::kKnown;
    return out;
  }
  const TomlTable frame = t.Table("frame");
  out.rotation = frame.NumbersOr("rotation", out.rotation, 3);
  out.shift = frame.NumbersOr("shift", out.shift, 3);
  out.kind = StudyKnowledge::kKnown;
  if (!frame.Has("sigma_rotation") && !frame.Has("sigma_shift")) return out;
  out.kind = StudyKnowledge::kNormal;
  out.sigma_rotation = frame.Number("sigma_rotation", kPositive);
  out.sigma_shift = frame.Number("sigma_shift", kPositive);
  return out;
}

StudyChannel ReadChannel(const std::string& study, const std::string& name, const TomlTable& t) {
  StudyChannel c;
  c.name = name;
  c.at = t.Where();
  c.file = Beside(study, t.String("file"));
  c.column = t.StringOr("column", name);
  const std::vector<double> window = t.NumbersOr("window", {0.0, 0.0}, 2);
  c.window_low = window[0];
  c.window_high = window[1];
  if (t.Has("window") && !(window[0] < window[1])) {
    t.Fail("window", fmt::format("[{}, {}] encloses nothing", window[0], window[1]),
           "give [from, to] on the channel's clock, in seconds");
  }
  if (t.Has("event")) {
    ReadSwitch(t, &c);
  } else {
    ReadInstrument(t, &c);
  }
  return c;
}

StudyTrial ReadTrial(const std::string& study, const std::string& name, const TomlTable& t) {
  StudyTrial trial;
  trial.where = t.Where();
  trial.name = t.StringOr("name", name);
  for (const auto& [channel, table] : t.NamedTables("channel")) {
    trial.channels.push_back(ReadChannel(study, channel, table));
  }
  const bool marks =
      t.Has("tracks") || std::all_of(trial.channels.begin(), trial.channels.end(),
                                     [](const auto& c) { return c.quantity.empty(); });
  if (marks) trial.tracks = Beside(study, t.String("tracks"));
  trial.tracks_at = t.Where("tracks");
  if (t.Has("sigma")) trial.sigma = t.Number("sigma", kPositive);
  trial.marks = t.StringsOr("marks", {});
  trial.set = t.StringsOr("set", {});
  const std::vector<double> window = t.NumbersOr("window", {0.0, 0.0}, 2);
  trial.window_low = window[0];
  trial.window_high = window[1];
  if (t.Has("window") && !(window[0] < window[1])) {
    t.Fail("window", fmt::format("[{}, {}] encloses nothing", window[0], window[1]),
           "give [from, to] on the tracks' clock, in seconds");
  }
  if (const auto factors = t.TableOrNone("sigma_factor")) {
    for (const auto& [mark, holds] : factors->Outline()) {
      const std::string key = mark.substr(mark.rfind('.') + 1);
      (void)holds;
      trial.sigma_factors.emplace_back(key, factors->Number(key, kPositive));
    }
  }
  constexpr TomlRange kRate{-0.5, 0.5};
  trial.offset = ReadKnowledge(t, "offset", kAny);
  trial.drift = ReadKnowledge(t, "drift", kRate);
  trial.frame = ReadFrame(t);
  for (const auto& named : t.NamedTables("event")) {
    const TomlTable& table = named.second;
    StudyEvent event;
    event.at = table.Where();
    event.kind =
        table.ChoiceOr("kind", "latch", {"latch", "contact_start", "contact_end", "watch"});
    event.where = table.String(event.kind == "watch" ? "watch" : "joint");
    event.count = table.IntegerOr("count", 1, 1, 1000000);
    event.time = table.Number("time");
    event.sigma = table.Number("sigma", kPositive);
    trial.events.push_back(std::move(event));
  }
  return trial;
}

StudyCommand ReadCommand(const std::string& study, const TomlTable& t) {
  StudyCommand command;
  command.where = t.Where("command");
  command.words = t.Strings("command");
  if (command.words.empty()) {
    t.Fail("command", "an empty command", "name a program and its arguments, one word each");
  }
  for (const std::string& file : t.StringsOr("files", {})) {
    command.files.push_back(Beside(study, file));
  }
  command.tracks = t.StringOr("tracks", "tracks.csv");
  command.timeout = t.NumberOr("timeout", command.timeout, kPositive);
  command.retries = t.IntegerOr("retries", 0, 0, 100);
  command.finer = t.StringsOr("finer", {});
  return command;
}

void ReadSolver(const TomlTable& t, Study* study) {
  if (t.IsString("stages")) {
    study->stages_by_impacts = t.Choice("stages", {"impacts"}) == "impacts";
  } else {
    study->stages = t.NumbersOr("stages", {}, -1, kPositive);
  }
  if (!std::is_sorted(study->stages.begin(), study->stages.end())) {
    t.Fail("stages", "the ends do not rise", "list them in order of time, in seconds");
  }
  study->max_iterations = t.IntegerOr("max_iterations", study->max_iterations, 1, 1000);
  study->screened = t.IntegerOr("screened", study->screened, 0, 100000);
  study->starts = t.IntegerOr("starts", study->starts, 1, 1000);
  if (study->starts > 1 && std::max(0, study->screened) + 1 < study->starts) {
    t.Fail("starts",
           fmt::format("{} starts of {} points", study->starts, std::max(0, study->screened) + 1),
           "set screened to several times as many as starts");
  }
  study->seed = t.IntegerOr("seed", study->seed, 0, 1000000000);
  study->whiten = t.BoolOr("whiten", study->whiten);
  if (!t.Has("free")) return;
  // One list of names per stage, the whole record's last.
  const std::size_t stages = study->stages.size() + 1;
  const TomlTable lists = t.Items("free", static_cast<int>(stages));
  for (std::size_t s = 0; s < stages; ++s) {
    study->free.push_back(lists.Strings(std::to_string(s)));
    for (const std::string& name : study->free.back()) {
      const bool known = std::any_of(study->parameters.begin(), study->parameters.end(),
                                     [&](const StudyParameter& p) { return p.name == name; });
      if (!known) {
        t.Fail("free", fmt::format("there is no parameter '{}'", name),
               "name parameters of this study; an empty list frees all");
      }
    }
  }
}

StudyFidelity::Rung ReadRung(const TomlTable& t) {
  StudyFidelity::Rung rung;
  rung.name = t.StringOr("name", "");
  rung.set = t.StringsOr("set", {});
  if (t.Has("segments")) rung.segments = t.Integer("segments", 1, kMostSegments);
  if (t.Has("order")) rung.order = t.Integer("order", 1, kHighestOrder);
  if (rung.segments > 0 && rung.order > 0) {
    t.Fail("order", "a beam of segments has none", "keep one of segments, order");
  }
  if (t.Has("error")) rung.error = t.Number("error", kPositive);
  return rung;
}

// "segments = [8, 12, 16]": one rung for each; the same of "order", for smooth beams.
void ReadRungList(const TomlTable& t, const char* key, int most,
                  std::vector<StudyFidelity::Rung>* rungs) {
  double last = 0.0;
  for (double number : t.NumbersOr(key, {}, -1, {1.0, static_cast<double>(most)})) {
    if (number != std::floor(number) || number <= last) {
      t.Fail(key, fmt::format("{} after {}", number, last), "give rising whole numbers");
    }
    last = number;
    StudyFidelity::Rung rung;
    (std::string(key) == "segments" ? rung.segments : rung.order) = static_cast<int>(number);
    rungs->push_back(rung);
  }
}

void ReadFidelity(const TomlTable& root, Study* study) {
  if (root.Has("mesh_check")) {
    root.Fail("mesh_check", "the check of the mesh has become a ladder of meshes",
              "leave it out, or give fidelity.segments = [coarse, .., fine]; docs/study.md");
  }
  const auto table = root.TableOrNone("fidelity");
  if (!table) return;
  StudyFidelity& out = study->fidelity;
  out.wanted = table->BoolOr("wanted", true);
  ReadRungList(*table, "segments", kMostSegments, &out.rungs);
  ReadRungList(*table, "order", kHighestOrder, &out.rungs);
  const std::vector<TomlTable> tables = table->TableArray("rung");
  if (!tables.empty() && !out.rungs.empty()) {
    table->Fail("rung", "rungs are given twice", "keep one of rung, and segments and order");
  }
  for (const TomlTable& t : tables) out.rungs.push_back(ReadRung(t));
  if (study->command && !out.rungs.empty()) {
    root.Fail("fidelity", "rungs of a program", "give the finer program as model.finer");
  }
}

// The model: a program, or the simulator and its scene.
void ReadModel(const TomlTable& root, const std::string& path, Study* study) {
  const TomlTable head = root.Table("study");
  study->name = head.StringOr("name", std::filesystem::path(path).stem().string());
  const auto model = root.TableOrNone("model");
  if (model && model->Has("command")) {
    study->command = ReadCommand(path, *model);
    if (head.Has("scene")) {
      head.Fail("scene", "there is a scene and a command",
                "keep one of study.scene, model.command");
    }
  } else {
    study->scene = Beside(path, head.String("scene"));
    study->scene_at = head.Where("scene");
    study->set = head.StringsOr("set", {});
  }
}

void ReadTrials(const TomlTable& root, const std::string& path, Study* study) {
  if (!root.IsArray("trial")) {
    study->trials.push_back(ReadTrial(path, "trial", root.Table("trial")));
    return;
  }
  const std::vector<TomlTable> trials = root.TableArray("trial");
  for (std::size_t i = 0; i < trials.size(); ++i) {
    study->trials.push_back(ReadTrial(path, fmt::format("trial {}", i + 1), trials[i]));
  }
}

// Each key of the scene is driven by one parameter.
void ReadParameters(const TomlTable& root, Study* study) {
  for (const auto& [name, table] : root.NamedTables("parameter")) {
    study->parameters.push_back(ReadParameter(name, table, study->command.has_value()));
  }
  if (study->parameters.empty()) {
    root.Fail("parameter", "a study without parameters", "add a table [parameter.NAME]");
  }
  std::map<std::string, std::string> driven;
  for (const StudyParameter& p : study->parameters) {
    for (const std::string& key : p.keys) {
      const auto [by, first] = driven.try_emplace(key, p.name);
      if (first) continue;
      root.Table("parameter")
          .Table(p.name)
          .Fail("keys", fmt::format("{} is driven by {} already", key, by->second),
                "let each key of the scene be driven by one parameter");
    }
  }
}

void ReadTolerance(const TomlTable& model, Study* study) {
  if (model.IsString("rtol")) {
    model.Choice("rtol", {"auto"});
  } else {
    study->rtol = model.NumberOr("rtol", study->rtol, {1e-12, 1e-2});
  }
}

void ReadRepeat(const TomlTable& root, Study* study) {
  const auto table = root.TableOrNone("repeat");
  if (!table) return;
  study->repeat.wanted = true;
  study->repeat.where = table->Where();
  study->repeat.parameters = table->StringsOr("parameters", {});
  for (const std::string& name : study->repeat.parameters) {
    const bool known = std::any_of(study->parameters.begin(), study->parameters.end(),
                                   [&](const StudyParameter& p) { return p.name == name; });
    if (!known) {
      table->Fail("parameters", fmt::format("there is no parameter '{}'", name),
                  "name parameters of this study; without the key all of them scatter");
    }
  }
}

Study ReadStudyFrom(const TomlTable& root, const std::string& path) {
  Study study;
  study.path = path;
  ReadModel(root, path, &study);
  ReadTrials(root, path, &study);
  ReadParameters(root, &study);
  const auto model = root.TableOrNone("model");
  if (model && !study.command) ReadTolerance(*model, &study);
  if (const auto solver = root.TableOrNone("solver")) ReadSolver(*solver, &study);
  if (const auto profile = root.TableOrNone("profile")) {
    study.profile_levels = profile->NumbersOr("levels", study.profile_levels, -1, kPositive);
    std::sort(study.profile_levels.begin(), study.profile_levels.end());
    study.profile_evaluations =
        profile->IntegerOr("max_evaluations", study.profile_evaluations, 1, 1000000);
  }
  ReadFidelity(root, &study);
  ReadRepeat(root, &study);
  root.RefuseUnknownKeys();
  return study;
}

}  // namespace

Study ReadStudy(const std::string& path, const std::vector<std::string>& overrides) {
  const TomlTable root = LoadToml(path, overrides);
  return ReadAsKind(root, "study", [&] { return ReadStudyFrom(root, path); });
}

Study ParseStudy(const std::string& text, const std::string& name) {
  return ReadStudyFrom(ParseToml(text, name), name);
}

}  // namespace unfurl::data
