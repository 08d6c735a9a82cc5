#include "cli/fit_engine.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <optional>

#include "base/error.h"
#include "base/text.h"
#include "campaign/folder_workers.h"
#include "campaign/slurm.h"
#include "campaign/slurm_pilots.h"

namespace unfurl::cli {

namespace {

constexpr std::size_t kSlurmWorkers = 8;  // where none is given: a start and its differences
// Below it, finding a question and handing it back takes more than answering it [s].
constexpr double kShort = 0.5;

}  // namespace

struct FitEngine::Parts {
  std::optional<campaign::EvaluationFolder> folder;
  std::optional<campaign::SlurmPilots> pilots;
  std::optional<campaign::FolderWorkers> workers;
  bool good = false;

  ~Parts() {
    // The folder last: it is what the others live in.
    workers.reset();
    pilots.reset();
    if (folder) folder->Close(!good);
  }
};

void AddFitEngine(CLI::App* app, FitEngineArguments* a) {
  app->add_option("--workers", a->workers,
                  fmt::format("Simulations at a time (default: one per core; of Slurm {} jobs); does "
                              "not change the result",
                              kSlurmWorkers));
  app->add_option("--engine", a->engine,
                  "local: this process; slurm: jobs of a cluster, for simulations of seconds and "
                  "more; folder: whoever runs --serve FOLDER")
      ->check(CLI::IsMember({"local", "slurm", "folder"}))
      ->capture_default_str()
      ->type_name("NAME");
  app->add_option("--folder", a->folder,
                  "Where questions and answers lie, seen by all machines (default: OUTPUT.questions)")
      ->type_name("QUESTIONS");
  app->add_option("--sbatch", a->sbatch,
                  "An option of Slurm's sbatch, joined by \"=\": --sbatch=--time=02:00:00 (repeatable)")
      ->type_name("OPTION")
      ->expected(1);
  app->add_option("--serve", a->serve,
                  "Answer the questions of the same fit, started elsewhere with --engine, until it "
                  "ends")
      ->type_name("QUESTIONS");
}

void Check(const FitEngineArguments& a) {
  if (!a.serve.empty() && (a.Shares() || !a.folder.empty())) {
    throw Error("is for a fit, and --serve works for one", a.Shares() ? "--engine" : "--folder",
                "leave it out");
  }
  if (!a.Shares() && !a.folder.empty()) {
    throw Error("is for --engine slurm or folder", "--folder", "leave it out, or name the engine");
  }
  if (a.engine != "slurm" && !a.sbatch.empty()) {
    throw Error("is for --engine slurm", "--sbatch", "leave it out, or name the engine");
  }
}

FitEngine::FitEngine(FitEngineArguments arguments, std::vector<std::string> words,
                     const std::string& output, bool talk)
    : arguments_(std::move(arguments)), words_(std::move(words)), talk_(talk) {
  if (arguments_.folder.empty()) arguments_.folder = output + ".questions";
}

FitEngine::~FitEngine() = default;

correlate::Workers* FitEngine::Begin(const std::vector<const correlate::FitProblem*>& problems,
                                     const std::string& identity) {
  if (!arguments_.Shares()) return nullptr;
  parts_ = std::make_unique<Parts>();
  Parts& p = *parts_;
  p.folder.emplace(campaign::EvaluationFolder::Make(arguments_.folder, identity));
  words_.insert(words_.end(), {"--serve", arguments_.folder});
  std::function<void(std::uint64_t)> watch;
  if (arguments_.engine == "slurm") {
    words_.insert(words_.end(), {"--workers", "1", "--quiet"});
    const std::size_t count = arguments_.workers == 0 ? kSlurmWorkers : arguments_.workers;
    p.pilots.emplace(*p.folder, words_, count, arguments_.sbatch);
    watch = [&p](std::uint64_t answers) { p.pilots->Watch(answers); };
    if (talk_) fmt::print(stderr, "unfurl: {} jobs are in Slurm's queue\n", count);
  } else if (talk_) {
    std::string command;
    for (const std::string& word : words_) {
      const bool plain = word.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWX"
                                                "YZ0123456789-_./=,:") == std::string::npos;
      command += (command.empty() ? "" : " ") + (plain ? word : campaign::ShellQuoted(word));
    }
    fmt::print(stderr, "unfurl: waits for workers; start any number of: {}\n", command);
  }
  p.workers.emplace(*p.folder, problems, std::move(watch));
  return &*p.workers;
}

void FitEngine::Finish() {
  if (!parts_) return;
  parts_->good = true;
  const double mean = parts_->workers->MeanSeconds();
  if (talk_ && parts_->workers->answers() > 0 && mean < kShort) {
    fmt::print(stderr,
               "unfurl: a simulation took {:.2g} s; below {:g} s threads of one machine (--engine "
               "local) are quicker\n",
               mean, kShort);
  }
  parts_.reset();
}

}  // namespace unfurl::cli
