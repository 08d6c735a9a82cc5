// `unfurl campaign`: many runs of one job, and what they say.
#include "campaign/campaign.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/cpu_time.h"
#include "base/error.h"
#include "base/progress.h"
#include "base/text.h"
#include "campaign/answers.h"
#include "campaign/answers_json.h"
#include "campaign/growth.h"
#include "campaign/rare.h"
#include "campaign/record.h"
#include "campaign/slurm_engine.h"
#include "cli/campaign_page.h"
#include "cli/campaign_rare.h"
#include "cli/campaign_slurm.h"
#include "cli/campaign_text.h"
#include "cli/verb.h"
#include "data/campaign.h"

namespace unfurl::cli {

namespace {

namespace fs = std::filesystem;
using campaign::CampaignFolder;
using campaign::EngineOptions;
using campaign::OpenCampaign;
using nlohmann::ordered_json;

constexpr double kSlurmPart = 60.0;  // a task's length where none is given [s]

struct CampaignArguments {
  std::string action = "run", input, out, report, folder, engine = "local", shard, rows, until;
  std::vector<std::string> sets;
  std::optional<double> part;  // [s]
  std::uint64_t runs = 0;
  std::size_t workers = 0;
  bool allow_programs = false, wait = false, keep = false;
};

bool IsFolder(const std::string& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored);
}

bool WritesRecord(const CampaignArguments& a) {
  return a.action != "status" && a.action != "cancel" && a.action != "answers" && a.shard.empty() &&
         a.rows.empty();
}

std::string FolderOf(const CampaignArguments& a) {
  if (IsFolder(a.input)) return a.input;
  return a.folder.empty() ? campaign::DefaultFolder(a.input) : a.folder;
}

// The record's name where none is given: "boom.h5" for plans/boom.toml and for boom.runs.
std::string DefaultRecord(const CampaignArguments& a) {
  if (!WritesRecord(a)) return {};
  return DefaultOutput(fs::path(a.input).lexically_normal().string(), ".h5");
}

campaign::JobOptions JobOf(const CampaignArguments& a) {
  return {fs::read_symlink("/proc/self/exe").string(), ProgramsAllowed(a.allow_programs)};
}

data::Campaign PlanOf(const CampaignArguments& a) {
  std::vector<std::string> sets = a.sets;
  if (a.runs > 0) sets.push_back(fmt::format("campaign.runs={}", a.runs));
  if (!a.until.empty()) sets.push_back("campaign.until=" + a.until);
  return data::ReadCampaign(a.input, sets);
}

OpenCampaign OpenFor(const CampaignArguments& a) {
  if (!IsFolder(a.input)) return campaign::OpenPlan(PlanOf(a), FolderOf(a), JobOf(a));
  if (!a.sets.empty() || a.runs > 0 || !a.until.empty()) {
    throw Error("changes a plan, and this is a campaign's folder",
                !a.sets.empty() ? "--set"
                : a.runs > 0    ? "--runs"
                                : "--until",
                "give the plan in place of the folder");
  }
  return campaign::OpenFolder(a.input, JobOf(a));
}

EngineOptions EngineOf(const CampaignArguments& a) {
  EngineOptions options;
  options.program = JobOf(a).program;
  options.workers = a.workers;
  options.allow_programs = ProgramsAllowed(a.allow_programs);
  return options;
}

// "3/64", counted from 1.
campaign::RunRange ShardOf(const std::string& text, std::uint64_t runs) {
  const std::size_t slash = text.find('/');
  double i = 0.0, n = 0.0;
  const bool good = slash != std::string::npos && ParseDouble(text.substr(0, slash), &i) &&
                    ParseDouble(text.substr(slash + 1), &n) && i >= 1.0 && i <= n &&
                    n <= static_cast<double>(runs) && i == std::floor(i) && n == std::floor(n);
  if (!good) {
    throw Error(fmt::format("'{}' is no shard of {} runs", text, runs), "--shard",
                "give I/N: 1/64 to 64/64 are all, and no more shards than runs");
  }
  return campaign::ShardRange(runs, static_cast<std::uint64_t>(i), static_cast<std::uint64_t>(n));
}

campaign::RunRange RangeOf(const CampaignArguments& a, std::uint64_t runs) {
  if (!a.shard.empty()) return ShardOf(a.shard, runs);
  campaign::RunRange range;
  if (!campaign::ParseRange(a.rows, &range) || range.end() > runs) {
    throw Error(fmt::format("'{}' is no range of {} runs", a.rows, runs), "--rows",
                "give FIRST:END, 0:100 for the first hundred");
  }
  return range;
}

int ComputeShard(const Common& common, const CampaignArguments& a) {
  // Before a folder is made.
  if (!IsFolder(a.input)) RangeOf(a, campaign::Inputs(PlanOf(a)).runs());
  const OpenCampaign c = OpenFor(a);
  const campaign::RunRange range = RangeOf(a, c.inputs.runs());
  Progress progress("campaign", !common.quiet);
  campaign::ComputePart(c, range, [&](std::uint64_t done) {
    progress.Update(static_cast<double>(done) / static_cast<double>(range.count));
  });
  const std::string path = c.folder.PartPath(range);
  Finish(common, {{"part", path}, {"first", range.first}, {"count", range.count}},
         fmt::format("runs {} to {} -> {}\n", range.first, range.end() - 1, path));
  return kExitGood;
}

int ShowAnswers(const Common& common, const CampaignArguments& a, const std::string& path,
                const ordered_json& extra, const std::string& head) {
  const campaign::CampaignRecord record = campaign::ReadRecord(path);
  const campaign::CampaignAnswers answers = campaign::Answer(record);
  ordered_json json = campaign::AnswersJson(answers);
  json.update(extra);
  std::string text = head + CampaignText(answers);
  if (!a.report.empty()) {
    WriteCampaignPage(a.report, record, answers, StartProvenance(common), path);
    text += "page -> " + a.report + "\n";
    json["report"] = a.report;
  }
  Finish(common, json, text);
  return answers.usable ? kExitGood : NotUsable(path, answers.message);
}

int MergeAndAnswer(const Common& common, const CampaignArguments& a, const OpenCampaign& c,
                   const ordered_json& extra, const std::string& head) {
  campaign::MergeParts(c.folder, c.inputs, c.files, a.out);
  const int code = ShowAnswers(common, a, a.out, extra, head + fmt::format("runs -> {}\n", a.out));
  // What was given by name is not ours to remove.
  if (!a.keep && a.folder.empty() && !IsFolder(a.input)) c.folder.Remove();
  return code;
}

// Here, by processes of this machine.
int RunHere(const Common& common, const CampaignArguments& a) {
  OpenCampaign c = OpenFor(a);
  const CampaignFolder::Lock lock(c.folder);
  EngineOptions options = EngineOf(a);
  const double cpu = CpuSeconds();
  campaign::EngineReport report;
  std::string head;
  {
    Progress progress("campaign", !common.quiet && !common.json);
    options.progress = [&](std::uint64_t done) {
      const auto runs = c.inputs.runs();
      progress.Update(std::min(0.99, static_cast<double>(done) / static_cast<double>(runs)),
                      CampaignNote(done, runs));
    };
    const std::uint64_t there = c.inputs.runs() - c.folder.MissingRuns(c.inputs.runs());
    if (there > 0) head = fmt::format("{} runs were there\n", there);
    if (c.inputs.plan().design.until.empty()) {
      report = campaign::RunLocally(c.folder, c.inputs.runs(), options);
    } else {
      report = campaign::GrowUntil(&c, [&](const OpenCampaign& now) {
        return campaign::RunLocally(now.folder, now.inputs.runs(), options);
      });
    }
  }
  const ordered_json extra = {{"output", a.out},
                              {"engine",
                               {{"name", "local"},
                                {"parts", report.parts},
                                {"run_seconds", report.run_seconds},
                                {"own_cpu_seconds", CpuSeconds() - cpu}}}};
  return MergeAndAnswer(common, a, c, extra, head);
}

int ShowRare(const Common& common, const CampaignArguments& a, const std::string& path,
             const campaign::RareResult& rare, const std::string& head) {
  ordered_json json = campaign::RareJson(rare);
  json["output"] = path;
  std::string text = head + RareText(rare);
  if (!a.report.empty()) {
    WriteRarePage(a.report, rare, StartProvenance(common), path);
    text += "page -> " + a.report + "\n";
    json["report"] = a.report;
  }
  Finish(common, json, text);
  return rare.usable ? kExitGood : NotUsable(path, rare.message);
}

int RunRare(const Common& common, const CampaignArguments& a) {
  if (IsFolder(a.input)) {
    throw Error("is a campaign's folder, and this design goes on from its plan", a.input,
                "give the plan");
  }
  if (a.engine == "slurm") {
    throw Error("is not for a design \"rare\", whose next runs hang on the last", "--engine slurm",
                "take --engine local");
  }
  campaign::RareResult rare;
  {
    Progress progress("campaign", !common.quiet && !common.json);
    rare = campaign::RunRare(
        PlanOf(a), FolderOf(a), JobOf(a), EngineOf(a), a.out,
        [&](double part, const std::string& note) { progress.Update(part, note); });
  }
  const int code = ShowRare(common, a, a.out, rare, fmt::format("runs -> {}\n", a.out));
  if (!a.keep && a.folder.empty()) campaign::RemoveRare(FolderOf(a));
  return code;
}

int RunBySlurm(const Common& common, const CampaignArguments& a) {
  OpenCampaign c = OpenFor(a);
  const CampaignFolder::Lock lock(c.folder);
  const bool grows = !c.inputs.plan().design.until.empty();
  const EngineOptions options = EngineOf(a);
  const double seconds = a.part.value_or(kSlurmPart);
  campaign::SlurmJobs jobs = campaign::ReadSlurmJobs(c.folder);
  if (a.wait) {
    {
      Progress progress("campaign", !common.quiet && !common.json);
      if (grows) {
        GrowBySlurm(&c, options, seconds, &jobs, &progress);
      } else {
        HandToSlurm(c, options, seconds, &jobs);
        WaitForSlurm(c, options, &jobs, &progress);
      }
    }
    return MergeAndAnswer(
        common, a, c, {{"output", a.out}, {"engine", {{"name", "slurm"}, {"shards", jobs.shards}}}},
        "");
  }
  const std::uint64_t handed = HandToSlurm(c, options, seconds, &jobs);
  ordered_json status = CampaignStatus(c, jobs);
  status["handed_over"] = handed;
  Finish(common, status,
         fmt::format("{} shards of {} handed over to Slurm\n", handed, jobs.shards) +
             CampaignStatusText(status) +
             fmt::format("`unfurl campaign status {0}` tells how far it is, `unfurl campaign merge "
                         "{0} -o {1}` ends it\n",
                         c.folder.path(), a.out));
  return kExitGood;
}

int AnswersOf(const Common& common, const CampaignArguments& a) {
  if (campaign::IsRare(a.input)) {
    return ShowRare(common, a, a.input, campaign::ReadRare(a.input), "");
  }
  return ShowAnswers(common, a, a.input, ordered_json::object(), "");
}

void Check(const CampaignArguments& a) {
  if (a.part && !(*a.part > 0.0 && std::isfinite(*a.part))) {
    throw Error(fmt::format("{:g} s is no time", *a.part), "--part", "give seconds above 0");
  }
  if (!a.shard.empty() && !a.rows.empty()) {
    throw Error("stands beside --shard", "--rows", "give one of them");
  }
  if ((!a.shard.empty() || !a.rows.empty()) && a.action != "run") {
    throw Error("is for a run, and this is " + a.action, a.shard.empty() ? "--rows" : "--shard",
                "leave it out");
  }
  if (a.engine == "local" && a.action == "run" && (a.wait || a.part)) {
    throw Error("is for --engine slurm", a.wait ? "--wait" : "--part", "leave it out");
  }
  if (a.action == "resume" && !IsFolder(FolderOf(a))) {
    throw Error("is not there", FolderOf(a), "`unfurl campaign PLAN.toml` begins one");
  }
}

// Before a folder is made.
void CheckUntil(const CampaignArguments& a, const data::Campaign& plan) {
  if (plan.design.until.empty() || a.wait) return;
  throw Error("wants somebody who looks at the answer and adds runs", "campaign.until",
              "give --wait, or a number of runs");
}

int RunCampaign(const Common& common, const CampaignArguments& a) {
  Check(a);
  if (a.action == "answers") return AnswersOf(common, a);
  if (!a.shard.empty() || !a.rows.empty()) return ComputeShard(common, a);
  if (a.action == "run" || a.action == "resume") {
    const data::Campaign plan =
        IsFolder(a.input) ? CampaignFolder::Open(a.input).ReadPlan() : PlanOf(a);
    if (plan.design.kind == data::CampaignDesign::Kind::kRare) return RunRare(common, a);
    const bool slurm = IsFolder(FolderOf(a)) &&
                       fs::exists(fs::path(FolderOf(a)) / "campaign.json") &&
                       campaign::ReadSlurmJobs(CampaignFolder::Open(FolderOf(a))).shards > 0;
    if (a.engine != "slurm" && (a.action != "resume" || !slurm)) return RunHere(common, a);
    CheckUntil(a, plan);
    return RunBySlurm(common, a);
  }
  if (!IsFolder(FolderOf(a))) {
    throw Error("is not there", FolderOf(a), "`unfurl campaign PLAN.toml` begins one");
  }
  CampaignArguments of_folder = a;
  of_folder.input = FolderOf(a);
  const OpenCampaign c = OpenFor(of_folder);
  const campaign::SlurmJobs jobs = campaign::ReadSlurmJobs(c.folder);
  if (a.action == "merge") {
    const CampaignFolder::Lock lock(c.folder);
    return MergeAndAnswer(common, a, c, {{"output", a.out}}, "");
  }
  if (a.action == "cancel") campaign::CancelSlurm(jobs);
  const ordered_json status = CampaignStatus(c, jobs);
  Finish(common, status, CampaignStatusText(status));
  return kExitGood;
}

}  // namespace

Verb AddCampaign(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(program, common, "campaign",
                          "Many runs over distributions of a job's numbers, and what they say",
                          "unfurl campaign plan.toml -o runs.h5 --report runs.html\n"
                          "  unfurl campaign plan.toml --engine slurm\n"
                          "  unfurl campaign status plan.runs");
  CLI::App* app = verb.app;
  VerbFiles& files = *verb.files;
  auto a = std::make_shared<CampaignArguments>();
  app->validate_positionals();
  app->add_option("ACTION", a->action,
                  "run (default), resume, status, merge, cancel; answers: of a record, without "
                  "new runs")
      ->check(
          CLI::IsMember({"run", "resume", "status", "merge", "cancel", "answers"}).description(""))
      ->type_name("run|resume|status|merge|cancel|answers");
  files.Read("INPUT", &a->input, "The plan (TOML), its folder of parts, or a record (answers)")
      ->required();
  files.WriteOr(
      "-o,--output", &a->out, [a] { return DefaultRecord(*a); },
      "The record of all runs to write (default: the plan's name, .h5)");
  files.Page(&a->report, "Also write a page with pictures (HTML)");
  files.Overrides(&a->sets, "Overrides a key of the plan (repeatable)");
  app->add_option("--runs", a->runs, "So many runs (campaign.runs)")->check(CLI::PositiveNumber);
  app->add_option("--until", a->until,
                  "Add runs until an answer is as sharp: \"P(latched) +- 0.002\" (campaign.until)")
      ->type_name("ANSWER");
  app->add_option("--engine", a->engine,
                  "local: processes of this machine; slurm: job arrays of a cluster")
      ->check(CLI::IsMember({"local", "slurm"}))
      ->capture_default_str()
      ->type_name("NAME");
  app->add_option("--workers", a->workers,
                  "Processes at a time (default: one per core); does not change the result");
  app->add_option(
      "--part", a->part,
      fmt::format("Seconds that a task of Slurm is to take (default: {:g})", kSlurmPart));
  app->add_flag("--wait", a->wait, "With Slurm: wait for the runs, and merge them");
  app->add_option("--folder", a->folder, "Where parts are kept (default: the plan's name, .runs)")
      ->type_name("PARTS");
  app->add_flag("--keep", a->keep, "Leave the parts when they are merged");
  app->add_option("--shard", a->shard,
                  "Compute one of N parts only, I/N from 1/N to N/N: for any scheduler")
      ->type_name("I/N");
  app->add_option("--rows", a->rows, "Compute these runs only, FIRST:END from 0")
      ->type_name("FIRST:END");
  AddAllowPrograms(app, &a->allow_programs);
  verb.run = [&common, a] { return RunCampaign(common, *a); };
  return verb;
}

}  // namespace unfurl::cli
