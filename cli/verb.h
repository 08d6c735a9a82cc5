#pragma once

#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/error.h"
#include "cli/verb_files.h"
#include "data/provenance.h"

namespace CLI {
class App;
}

namespace unfurl::cli {

// What every verb shares: the options --json and --quiet, and the command as typed.
struct Common {
  bool json = false;
  bool quiet = false;
  std::string command_line;
};

// One file per verb defines one of these: it declares its options on the program, those that are
// files by way of `files`, and gives what to run when its name was typed. `run` returns an exit
// code (0, or 1 for "ran but not usable"); everything else is thrown.
struct Verb {
  CLI::App* app = nullptr;
  std::shared_ptr<VerbFiles> files;
  std::function<int()> run;
};

Verb AddSimulate(CLI::App& program, Common& common);
Verb AddModes(CLI::App& program, Common& common);
Verb AddExpose(CLI::App& program, Common& common);
Verb AddCalibrate(CLI::App& program, Common& common);
Verb AddCheck(CLI::App& program, Common& common);
Verb AddPlan(CLI::App& program, Common& common);
Verb AddReconstruct(CLI::App& program, Common& common);
Verb AddStream(CLI::App& program, Common& common);
Verb AddCorrelate(CLI::App& program, Common& common);
Verb AddFit(CLI::App& program, Common& common);
Verb AddCost(CLI::App& program, Common& common);
Verb AddDesign(CLI::App& program, Common& common);
Verb AddEffects(CLI::App& program, Common& common);
Verb AddCampaign(CLI::App& program, Common& common);
Verb AddInfo(CLI::App& program, Common& common);
Verb AddConvert(CLI::App& program, Common& common);
Verb AddNew(CLI::App& program, Common& common);
Verb AddDoctor(CLI::App& program, Common& common);
Verb AddCompletion(CLI::App& program, Common& common);

// Declares a verb with --json, --quiet and an example in its --help.
Verb DeclareVerb(CLI::App& program, Common& common, const std::string& name,
                 const std::string& summary, const std::string& example);

// The record's name with another ending, for an output that was not named: "a/run.toml" and ".h5"
// give "run.h5" in the current folder.
std::string DefaultOutput(const std::string& input, const std::string& suffix);

// Provenance with this program's version and the command as typed; add inputs and options to it.
data::Provenance StartProvenance(const Common& common);

// One line on standard error for a result that is not usable, WHERE: WHY; returns that exit code.
int NotUsable(const std::string& where, const std::string& why);

// The same of a verb that begins with a study's fit.
int FitNotUsable(const std::string& study, const std::string& message);

// For a file or for stdout; bytes that are no UTF-8 (of a file's name) are replaced.
std::string JsonText(const nlohmann::ordered_json& json);

// Ends a verb: the summary as JSON on stdout with --json, `text` otherwise, nothing with --quiet.
void Finish(const Common& common, const nlohmann::ordered_json& summary, const std::string& text);

// An Error of a field of an options struct, placed at the option of the command line that fills it;
// `flags`: "DesignOptions.wanted" to "--for".
Error AtOption(const Error& error, const std::map<std::string, std::string>& flags);

// --need, the accuracy of found points that is aimed at, on calibrate, plan and check; its value in
// metres, 0 where it was not given. Throws Error for what is no length.
void AddNeedOption(CLI::App* app, std::string* text);
double NeedOption(const std::string& text);

// A length above 0 with its unit, as 0.5mm, of an option; [m]. Throws Error for any other text.
double LengthOption(const std::string& text, const std::string& option);

// --allow-programs, on verbs that evaluate a study; and whether it, or the environment, allows
// them.
void AddAllowPrograms(CLI::App* app, bool* allowed);
bool ProgramsAllowed(bool option);

}  // namespace unfurl::cli
