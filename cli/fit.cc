#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/count.h"
#include "base/error.h"
#include "base/progress.h"
#include "base/signals.h"
#include "campaign/folder_workers.h"
#include "cli/fit_engine.h"
#include "cli/fit_page.h"
#include "cli/fit_text.h"
#include "cli/repeat_page.h"
#include "cli/repeat_text.h"
#include "cli/terminal_plots.h"
#include "cli/verb.h"
#include "data/study.h"
#include "study/fit_study.h"
#include "study/repeat.h"

namespace unfurl::cli {

namespace {

struct FitSettings {
  std::string study, output, report, tracks;
  std::vector<std::string> sets;
  FitEngineArguments engine;
  bool resume = false, allow_programs = false, repeat = false, plot = false;
};

// The command as typed, less what does not shape the result: so a fit that was resumed, or run with
// other workers, is the same file to the last byte.
std::string CommandWithout(const std::string& command) {
  std::string out;
  bool skip = false;
  for (std::size_t from = 0; from < command.size();) {
    const std::size_t to = std::min(command.find(' ', from), command.size());
    const std::string word = command.substr(from, to - from);
    from = to + 1;
    if (skip) {
      skip = false;
      continue;
    }
    if (word == "--resume" || word == "--json" || word == "--quiet" || word == "--plot") continue;
    const std::string name = word.substr(0, word.find('='));
    if (name == "--workers" || name == "--engine" || name == "--folder" || name == "--sbatch") {
      skip = name == word;
      continue;
    }
    out += (out.empty() ? "" : " ") + word;
  }
  return out;
}

// "3 starts: 41 evaluations, best so far 1.2e+04 (clearance 0.0058), about 60 to go".
std::string ProgressNote(const correlate::FitProgress& at,
                         const std::vector<data::StudyParameter>& parameters) {
  std::string note = fmt::format("{}: {}", at.phase,
                                 Counted(static_cast<std::size_t>(at.evaluations), "evaluation"));
  if (at.best_cost > 0.0) {
    note += fmt::format(", best so far {:.5g}", at.best_cost);
    for (std::size_t j = 0; j < at.best_theta.size() && j < 3; ++j) {
      note +=
          fmt::format("{}{} {:.4g}", j == 0 ? " (" : ", ", parameters[j].name, at.best_theta[j]);
    }
    if (!at.best_theta.empty()) note += ")";
  }
  if (at.expected > at.evaluations) {
    note += fmt::format(", about {} to go", at.expected - at.evaluations);
  }
  return note;
}

using FitSeconds = std::function<double()>;  // since the start

// One value of each parameter for all trials.
int FitOnce(const Common& common, const FitSettings& s, const data::Study& study,
            const study::FitStudyOptions& options, const FitSeconds& seconds) {
  const study::StudyFit fit = study::Fit(study, options);
  if (!s.report.empty()) {
    WriteFitPage(s.report, {fit.record, fit.problem(), fit.result, fit.comparison, fit.motion,
                            fit.provenance});
  }
  const double took = seconds();
  std::string text = FitText(fit.record, took);
  if (s.plot || OnTerminal()) text += ResidualPlot(fit.record);
  Finish(common, FitJson(fit.record, options.output, took), text);
  return fit.Usable() ? kExitGood
                      : NotUsable(options.output, "the fit is not usable; the reasons are above");
}

// Trials that scatter.
int FitTrials(const Common& common, const FitSettings& s, const data::Study& study,
              const study::FitStudyOptions& options, const FitSeconds& seconds) {
  const study::RepeatFit fit = study::FitRepeat(study, options);
  if (!s.report.empty()) WriteRepeatPage(s.report, fit.record, fit.provenance);
  const double took = seconds();
  Finish(common, RepeatJson(fit.record, options.output, took), RepeatText(fit.record, took));
  return fit.Usable() ? kExitGood
                      : NotUsable(options.output, "too few trials; the reasons are above");
}

// The command by which another process answers what this fit asks, but for the folder.
std::vector<std::string> ServingWords(const FitSettings& s) {
  std::vector<std::string> words = {std::filesystem::read_symlink("/proc/self/exe").string(), "fit",
                                    s.study};
  for (const std::string& set : s.sets) words.insert(words.end(), {"--set", set});
  if (!s.tracks.empty()) words.insert(words.end(), {"--tracks", s.tracks});
  if (s.repeat) words.emplace_back("--repeat");
  if (ProgramsAllowed(s.allow_programs)) words.emplace_back("--allow-programs");
  return words;
}

// Works for a fit that another process runs.
int ServeFit(const Common& common, const FitSettings& s, const data::Study& study,
             const study::FitStudyOptions& options) {
  const study::StudyProblems problems = study::ProblemsOf(study, options);
  const auto folder = campaign::EvaluationFolder::Open(s.engine.serve, problems.identity);
  const std::uint64_t answered =
      campaign::ServeEvaluations(folder, problems.problems, s.engine.workers);
  Finish(common, {{"folder", s.engine.serve}, {"answered", answered}},
         fmt::format("{} simulations answered; the fit has ended\n", answered));
  return kExitGood;
}

int FitVerb(const Common& common, const FitSettings& s) {
  Check(s.engine);
  if (!s.engine.serve.empty() && (!s.report.empty() || s.resume)) {
    throw Error("is for a fit, and --serve works for one", s.resume ? "--resume" : "--report",
                "leave it out");
  }
  const auto start = std::chrono::steady_clock::now();
  data::Study study = data::ReadStudy(s.study, s.sets);
  study.repeat.wanted = study.repeat.wanted || s.repeat;
  study::FitStudyOptions options;
  options.tracks = s.tracks;
  options.workers = s.engine.workers;
  options.resume = s.resume;
  options.output = s.output;
  options.allow_programs = ProgramsAllowed(s.allow_programs);
  options.compare = options.keep_motion = !s.report.empty();
  options.provenance = StartProvenance(common);
  options.provenance.command = CommandWithout(options.provenance.command);
  for (const std::string& set : s.sets) {
    options.provenance.options["set " + set.substr(0, set.find('='))] =
        set.substr(set.find('=') + 1);
  }
  if (!s.engine.serve.empty()) return ServeFit(common, s, study, options);
  const bool talk = !common.quiet && !common.json;
  FitEngine engine(s.engine, s.engine.Shares() ? ServingWords(s) : std::vector<std::string>(),
                   s.output, talk);
  options.where = [&engine](const std::vector<const correlate::FitProblem*>& problems,
                            const std::string& identity) {
    return engine.Begin(problems, identity);
  };
  options.on_resume = [&](std::size_t found, const std::string& path) {
    if (talk)
      fmt::print(stderr, "unfurl: {} taken over from {}\n", Counted(found, "evaluation"), path);
  };
  Progress progress("fit", talk);
  options.progress = [&](const correlate::FitProgress& at) {
    progress.Update(static_cast<double>(at.evaluations) /
                        static_cast<double>(std::max<std::size_t>(at.expected, 1)),
                    ProgressNote(at, study.parameters));
  };
  const auto seconds = [start] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  try {
    const int code = study.repeat.wanted ? FitTrials(common, s, study, options, seconds)
                                         : FitOnce(common, s, study, options, seconds);
    engine.Finish();
    return code;
  } catch (const study::FitInterrupted& stopped) {
    Complain(fmt::format("interrupted; {} evaluations are in {}, --resume continues",
                         stopped.evaluations, stopped.journal));
    return kExitInterrupted;
  }
}

}  // namespace

Verb AddFit(CLI::App& program, Common& common) {
  Verb verb =
      DeclareVerb(program, common, "fit",
                  "Parameters of a model from recorded trials, with standard errors and verdicts",
                  "unfurl fit study.toml -o fit.h5 --report fit.html\n"
                  "  unfurl fit study.toml --engine slurm --workers 32 --sbatch=--time=02:00:00");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto settings = std::make_shared<FitSettings>();
  files.Read("STUDY", &settings->study, "The study (TOML)")->required();
  files.WriteOr(
      "-o,--output", &settings->output,
      [settings] {
        return settings->engine.serve.empty() ? DefaultOutput(settings->study, ".h5")
                                              : std::string();
      },
      "The fit to write (default: the study's name, .h5)");
  files.Page(&settings->report, "Also write a page with pictures (HTML)");
  files.Read("--tracks", &settings->tracks, "Tracks to fit to instead of the study's");
  files.Overrides(&settings->sets, "Overrides a key of the study (repeatable)");
  AddFitEngine(app, &settings->engine);
  AddAllowPrograms(app, &settings->allow_programs);
  app->add_flag("--repeat", settings->repeat,
                "The trials are deployments that differ: mean and scatter of each parameter, and "
                "the next deployment (as [repeat] in the study)");
  app->add_flag("--plot", settings->plot,
                "Also draw what the fit leaves, in characters (on a terminal it is drawn anyway)");
  app->add_flag("--resume", settings->resume,
                "Continue a fit that was stopped, from its OUTPUT.partial, to the same result");
  verb.run = [&common, settings] { return FitVerb(common, *settings); };
  return verb;
}

}  // namespace unfurl::cli
