#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <clocale>
#include <cstdio>
#include <locale>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "base/error.h"
#include "base/progress.h"
#include "base/signals.h"
#include "cli/usage.h"
#include "cli/verb.h"

namespace {

using unfurl::cli::Verb;

constexpr char kFooter[] =
    "To begin: unfurl new boom (or wing, rig, trial, study, campaign) makes a commented start that "
    "runs.\n\n"
    "The main job, in order:\n"
    "  unfurl simulate scene.toml -o run.h5               the deployment\n"
    "  unfurl expose --survey points.csv --lab lab.toml   a virtual survey, where there is no real "
    "one\n"
    "  unfurl expose run.h5 --lab lab.toml                a virtual trial, likewise\n"
    "  unfurl calibrate survey.h5 -o rig.h5               the cameras\n"
    "  unfurl reconstruct trial.h5 --rig rig.h5           the marks in time\n"
    "  unfurl correlate tracks.h5 run.h5                  both, side by side\n"
    "  unfurl fit study.toml                              the parameters, with standard errors\n\n"
    "Exit codes: 0 good, 1 ran but the result is not usable, 2 bad input, 3 internal error,\n"
    "4 the machine (disk full, no permission), 130 and 143 interrupted.\n"
    "`unfurl help VERB` lists the options of a verb and gives an example; `unfurl doctor` tells "
    "what\n"
    "this machine lacks.";

// The library says "option rate" of what is typed as --rate.
unfurl::Error AsTyped(const unfurl::Error& error) {
  constexpr std::string_view kOption = "option ";
  if (!error.where().starts_with(kOption)) return error;
  return {error.problem(), "--" + error.where().substr(kOption.size()), error.remedy(),
          error.kind()};
}

std::string CommandLine(int argc, char** argv) {
  std::string line = "unfurl";
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const bool plain =
        !argument.empty() && argument.find_first_of(" \t'\"\\$") == std::string::npos;
    line += plain ? " " + argument : " '" + argument + "'";
  }
  return line;
}

int Run(int argc, char** argv) {
  unfurl::cli::Common common;
  common.command_line = CommandLine(argc, argv);

  CLI::App program(
      "Unfurl: calibrate a rig of line cameras, reconstruct a deployment trial, simulate "
      "it, and fit the one to the other.");
  program.set_version_flag("-v,--version", unfurl::data::ProgramVersion());
  program.formatter(std::make_shared<unfurl::cli::ReadableFormatter>());  // which verbs inherit
  program.require_subcommand(1);
  program.footer(kFooter);
  std::vector<Verb> verbs;
  using AddVerb = Verb (*)(CLI::App&, unfurl::cli::Common&);
  const AddVerb all[] = {
      unfurl::cli::AddSimulate,    unfurl::cli::AddModes,     unfurl::cli::AddExpose,
      unfurl::cli::AddPlan,        unfurl::cli::AddCalibrate, unfurl::cli::AddCheck,
      unfurl::cli::AddReconstruct, unfurl::cli::AddCorrelate, unfurl::cli::AddFit,
      unfurl::cli::AddCost,        unfurl::cli::AddDesign,    unfurl::cli::AddEffects,
      unfurl::cli::AddCampaign,    unfurl::cli::AddInfo,      unfurl::cli::AddConvert,
      unfurl::cli::AddNew,         unfurl::cli::AddStream,    unfurl::cli::AddDoctor,
      unfurl::cli::AddCompletion};
  for (const AddVerb add : all) {
    verbs.push_back(add(program, common));
    verbs.back().files->CheckDeclared();
  }

  if (argc < 2) {
    std::fputs(program.help("unfurl").c_str(), stdout);
    throw unfurl::Error("names no verb", "command line", "see above; `unfurl new boom` begins");
  }
  if (argv[1] == std::string("help")) {
    unfurl::cli::PrintHelp(program, verbs, argc, argv);
    return unfurl::kExitGood;
  }
  try {
    program.parse(argc, argv);
  } catch (const CLI::Success& asked) {  // --help and --version
    return program.exit(asked);
  } catch (const CLI::ParseError& error) {
    throw unfurl::cli::UsageError(verbs, argc, argv, error);
  }
  for (const Verb& verb : verbs) {
    if (!verb.app->parsed()) continue;
    unfurl::cli::RefuseNegative(verb);
    verb.files->Prepare();
    const int code = verb.run();
    const std::string printed = verb.files->Print();
    if (!printed.empty() && !common.quiet && !common.json) fmt::print("-> {}\n", printed);
    return code;
  }
  return unfurl::kExitBadInput;
}

// A lack of memory, of threads, of a folder: in the machine's own words.
int MachineRefused(int argc, char** argv, const std::string& what) {
  unfurl::Complain(fmt::format("{}{}; free some of it, or take a larger machine",
                               argc > 1 ? std::string(argv[1]) + ": " : "", what));
  return unfurl::kExitMachine;
}

}  // namespace

int main(int argc, char** argv) {
  using unfurl::Complain;
  // Numbers have points, whatever a library has made of the environment before.
  std::setlocale(LC_ALL, "C");
  std::locale::global(std::locale::classic());
  unfurl::InstallInterruptHandler();
  int code = unfurl::kExitFault;
  try {
    code = Run(argc, argv);
  } catch (const unfurl::Error& error) {
    Complain(AsTyped(error).what());
    code =
        error.kind() == unfurl::ErrorKind::kMachine ? unfurl::kExitMachine : unfurl::kExitBadInput;
  } catch (const unfurl::Interrupted&) {
    Complain("interrupted; nothing was written");
    code = unfurl::kExitInterrupted;
  } catch (const std::bad_alloc&) {
    code = MachineRefused(argc, argv, "the machine has not enough memory for this");
  } catch (const std::length_error&) {  // more than any memory holds
    code = MachineRefused(argc, argv, "the machine has not enough memory for this");
  } catch (const std::system_error& error) {  // a thread, a folder
    code = MachineRefused(argc, argv, fmt::format("the machine refused: {}", error.what()));
  } catch (const std::exception& error) {
    const std::string what = error.what();
    if (what.find("Insufficient memory") != std::string::npos) {  // OpenCV has its own words
      code = MachineRefused(argc, argv, "the machine has not enough memory for this");
    } else {
      Complain("internal error: " + what + "; please report it with the command that you typed");
    }
  }
  // What was lost before the last piece is only remembered: an output of more than one buffer.
  const bool lost = std::fflush(stdout) != 0 || std::ferror(stdout) != 0;
  if (lost && code == unfurl::kExitGood) {
    Complain("standard output: cannot write; free some space or redirect it elsewhere");
    code = unfurl::kExitMachine;
  }
  return code == unfurl::kExitInterrupted ? unfurl::InterruptExitCode() : code;
}
