#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/progress.h"
#include "base/signals.h"
#include "cli/fit_page.h"
#include "cli/fit_text.h"
#include "cli/verb.h"
#include "data/study.h"
#include "study/fit_study.h"

namespace unfurl::cli {

namespace {

struct Settings {
  std::string study, output, report, tracks;
  std::vector<std::string> sets;
  std::size_t workers = 0;
  bool resume = false, allow_programs = false;
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
    if (word == "--resume" || word == "--json" || word == "--quiet") continue;
    if (word.rfind("--workers", 0) == 0) {
      skip = word == "--workers";
      continue;
    }
    out += (out.empty() ? "" : " ") + word;
  }
  return out;
}

// "3 starts: 41 evaluations, best so far 1.2e+04 (clearance 0.0058), about 60 to go".
std::string ProgressNote(const correlate::FitProgress& at,
                         const std::vector<data::StudyParameter>& parameters) {
  std::string note = fmt::format("{}: {} evaluations", at.phase, at.evaluations);
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

int FitVerb(const Common& common, const Settings& s) {
  const auto start = std::chrono::steady_clock::now();
  const data::Study study = data::ReadStudy(s.study, s.sets);
  study::FitStudyOptions options;
  options.tracks = s.tracks;
  options.workers = s.workers;
  options.resume = s.resume;
  options.output = s.output;
  options.allow_programs = ProgramsAllowed(s.allow_programs);
  options.compare = !s.report.empty();
  options.provenance = StartProvenance(common);
  options.provenance.command = CommandWithout(options.provenance.command);
  for (const std::string& set : s.sets) {
    options.provenance.options["set " + set.substr(0, set.find('='))] =
        set.substr(set.find('=') + 1);
  }
  const bool talk = !common.quiet && !common.json;
  options.on_resume = [&](std::size_t found, const std::string& path) {
    if (talk) fmt::print(stderr, "unfurl: {} evaluations taken over from {}\n", found, path);
  };
  Progress progress("fit", talk);
  options.progress = [&](const correlate::FitProgress& at) {
    const double done = static_cast<double>(at.evaluations) /
                        static_cast<double>(std::max(at.expected, at.evaluations + 1));
    progress.Update(std::min(0.99, done), ProgressNote(at, study.parameters));
  };
  study::StudyFit fit;
  try {
    fit = study::Fit(study, options);
  } catch (const study::FitInterrupted& stopped) {
    Complain(fmt::format("interrupted; {} evaluations are in {}, --resume continues",
                         stopped.evaluations, stopped.journal));
    return kExitInterrupted;
  }
  if (!s.report.empty()) {
    WriteFitPage(s.report, {fit.record, fit.problem(), fit.result, fit.comparison, fit.provenance});
  }
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  Finish(common, FitJson(fit.record, options.output, seconds), FitText(fit.record, seconds));
  return fit.Usable() ? kExitGood
                      : NotUsable(options.output, "the fit is not usable; the reasons are above");
}

}  // namespace

Verb AddFit(CLI::App& program, Common& common) {
  Verb verb =
      DeclareVerb(program, common, "fit",
                  "Parameters of a model from recorded trials, with standard errors and verdicts",
                  "unfurl fit study.toml -o fit.h5 --report fit.html");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto settings = std::make_shared<Settings>();
  files.Read("STUDY", &settings->study, "The study (TOML)")->required();
  files.WriteOr(
      "-o,--output", &settings->output,
      [settings] { return DefaultOutput(settings->study, ".h5"); },
      "The fit to write (default: the study's name, .h5)");
  files.Write("--report", &settings->report, "Also write a page with pictures (HTML)");
  files.Read("--tracks", &settings->tracks, "Tracks to fit to instead of the study's");
  files.Overrides(&settings->sets, "Overrides a key of the study (repeatable)");
  app->add_option("--workers", settings->workers,
                  "Simulations at a time (default: one per core); does not change the result");
  AddAllowPrograms(app, &settings->allow_programs);
  app->add_flag("--resume", settings->resume,
                "Continue a fit that was stopped, from its OUTPUT.partial, to the same result");
  verb.run = [&common, settings] { return FitVerb(common, *settings); };
  return verb;
}

}  // namespace unfurl::cli
