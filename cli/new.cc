#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>

#include "base/error.h"
#include "base/table.h"
#include "base/text.h"
#include "cli/starts.h"
#include "cli/verb.h"
#include "data/atomic_file.h"

namespace unfurl::cli {

namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct StartFile {
  const char* name;
  std::string_view text;
  const char* what;
};

// A commented start that runs as it is.
struct Start {
  const char* kind;
  const char* what;
  const char* change;  // first
  std::vector<StartFile> files;
  std::vector<const char*> commands;  // in order, in the new folder
};

const std::vector<Start>& Starts() {
  static const std::vector<Start> starts = {
      {"boom",
       "two tubes, a hinge, a latch",
       "lengths, masses and EI of the tubes, the hinge's spring, theta",
       {{"scene.toml", kBoomScene, "the structure"}, {"README.md", kBoomReadme, "what to run"}},
       {"unfurl simulate scene.toml --report boom.html"}},
      {"wing",
       "a free satellite, a yoke and three panels of smooth beams",
       "the satellite's mass and inertia, the panels, the springs",
       {{"scene.toml", kWingScene, "the structure"}, {"README.md", kWingReadme, "what to run"}},
       {"unfurl simulate scene.toml --report wing.html"}},
      {"rig",
       "four line cameras planned, a survey to rehearse, the form of a real one",
       "volume, places of the cameras, lens and sensor in lab.toml",
       {{"lab.toml", kRigLab, "the rig as planned"},
        {"points.csv", kRigPoints, "places for the surveyor's LED"},
        {"survey_template.csv", kRigTemplate, "the form of a real survey"},
        {"bar.csv", kRigBar, "places of a bar that is waved instead"},
        {"wand_template.csv", kRigBarTemplate, "the form of a real bar's readings"},
        {"README.md", kRigReadme, "what to run"}},
       {"unfurl plan lab.toml --report plan.html",
        "unfurl expose --survey points.csv --lab lab.toml -o survey.h5",
        "unfurl calibrate survey.h5 -o rig.h5 --report rig.html"}},
      {"trial",
       "raw lines of a frame grabber, described so that they become a trial",
       "sensor, cameras and files in lines.toml",
       {{"lines.toml", kTrialLines, "describes the recording"},
        {"stamps.csv", kTrialStamps, "when each line was, and what was lit"},
        {"door.csv", kTrialDoor, "ten lines of a camera, to be replaced"},
        {"window.csv", kTrialWindow, "of a second one"},
        {"bench.csv", kTrialBench, "of a third one"},
        {"README.md", kTrialReadme, "what to run"}},
       {"unfurl convert lines.toml trial.h5", "unfurl info trial.h5"}},
      {"study",
       "three parameters of the boom, fitted to a record of it",
       "trial.tracks, and the keys of the scene that each parameter drives",
       {{"study.toml", kStudyStudy, "what is fitted to what"},
        {"scene.toml", kStudyScene, "the model, as drawn"},
        {"tracks.csv", kStudyTracks, "the record"},
        {"README.md", kStudyReadme, "what to run, and how to read it"}},
       {"unfurl fit study.toml --report fit.html"}},
      {"campaign",
       "the boom over its tolerances: how often it latches, and how hard",
       "the variables, which are your tolerances, and the responses, your requirements",
       {{"plan.toml", kCampaignPlan, "what scatters, and what is asked"},
        {"scene.toml", kBoomScene, "the structure"},
        {"README.md", kCampaignReadme, "what to run, and how to read it"}},
       {"unfurl campaign plan.toml --report campaign.html"}},
  };
  return starts;
}

const Start& StartOf(const std::string& kind) {
  std::vector<std::string> kinds;
  for (const Start& start : Starts()) {
    if (start.kind == kind) return start;
    kinds.emplace_back(start.kind);
  }
  const std::string nearest = NearestName(kind, kinds);
  throw Error(fmt::format("there is no start '{}'", kind), "KIND",
              nearest.empty() ? "known: " + JoinWords(kinds) : "did you mean '" + nearest + "'?");
}

// All of them, or none: what was written before a failure is taken away again. Their paths are
// made before anything is written, for where memory lacks that is what fails.
void WriteAll(const Start& start, const fs::path& folder) {
  std::vector<fs::path> paths;
  for (const StartFile& file : start.files) {
    paths.push_back(folder / file.name);
    if (!fs::exists(fs::symlink_status(paths.back()))) continue;
    throw Error("is there already, and stays", paths.back().string(),
                "name another folder: unfurl new " + std::string(start.kind) + " FOLDER");
  }
  std::error_code failed;
  if (fs::exists(folder, failed) && !fs::is_directory(folder, failed)) {
    throw Error("is a file, where a folder is to be made", folder.string(),
                "name another folder: unfurl new " + std::string(start.kind) + " FOLDER");
  }
  const bool made = fs::create_directories(folder, failed);
  if (failed) {
    throw Error("cannot be made: " + failed.message(), folder.string(), "name another folder",
                ErrorKind::kMachine);
  }
  std::size_t tried = 0;
  try {
    while (tried < paths.size()) {
      const std::size_t k = tried++;  // one that fails may have its name by then
      data::WriteTextFile(paths[k].string(), std::string(start.files[k].text));
    }
  } catch (...) {
    for (std::size_t k = 0; k < tried; ++k) fs::remove(paths[k], failed);
    if (made) fs::remove(folder, failed);
    throw;
  }
}

int RunNew(const Common& common, const std::string& kind, const std::string& given) {
  const Start& start = StartOf(kind);
  const std::string folder = given.empty() ? kind : given;
  WriteAll(start, folder);
  ordered_json summary = {{"kind", kind}, {"folder", folder}};
  std::vector<std::vector<std::string>> rows = {{"file", "what it is"}};
  for (const StartFile& file : start.files) {
    summary["files"].push_back(file.name);
    rows.push_back({(fs::path(folder) / file.name).string(), file.what});
  }
  std::string text = AlignedTable(rows) + "\nIt runs as it is:\n";
  if (fs::path(folder).lexically_normal() != ".") text += fmt::format("  cd {}\n", folder);
  for (const char* command : start.commands) {
    summary["commands"].push_back(command);
    text += fmt::format("  {}\n", command);
  }
  text += fmt::format("Change first: {}.\n", start.change);
  Finish(common, summary, text);
  return kExitGood;
}

}  // namespace

Verb AddNew(CLI::App& program, Common& common) {
  Verb verb =
      DeclareVerb(program, common, "new",
                  "A commented start of your own: a structure, a rig, a trial, a study, a campaign",
                  "unfurl new boom my_boom");
  auto kind = std::make_shared<std::string>(), folder = std::make_shared<std::string>();
  verb.app->add_option("KIND", *kind, "What to start, see below")
      ->type_name("boom|wing|rig|trial|study|campaign")
      ->required();
  std::vector<std::string> names;
  std::string footer = "Starts, each of which runs at once:\n";
  for (const Start& start : Starts()) {
    footer += fmt::format("  {:<8} {}\n           change first: {}\n", start.kind, start.what,
                          start.change);
    for (const StartFile& file : start.files) names.emplace_back(file.name);
  }
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  verb.files->FillFolder(
      "DIR", folder.get(), [names] { return names; },
      "The folder to make (default: the kind's name); files that are there stay");
  verb.app->footer(footer + "\nExample:\n  unfurl new boom my_boom");
  verb.run = [&common, kind, folder] { return RunNew(common, *kind, *folder); };
  return verb;
}

}  // namespace unfurl::cli
