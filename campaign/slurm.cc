#include "campaign/slurm.h"

#include <fmt/format.h>

#include <filesystem>

#include "base/error.h"
#include "base/subprocess.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/scratch_folder.h"

namespace unfurl::campaign {

namespace {

constexpr double kPatience = 60.0;                 // for an answer of the controller [s]
constexpr std::uint64_t kDefaultArraySize = 1001;  // Slurm's own default of MaxArraySize

struct SlurmAnswer {
  int code = 0;
  std::string out, err;
};

// A program of Slurm.
SlurmAnswer Ask(const std::vector<std::string>& words) {
  const data::ScratchFolder scratch("unfurl-slurm-");
  const std::string out = scratch.File("out"), err = scratch.File("err");
  const ProgramOutcome outcome =
      RunProgram(words, std::filesystem::current_path().string(), out, err, kPatience);
  if (!outcome.started) {
    throw Error("there is no '" + words.front() + "' here", "--engine slurm",
                "run it where Slurm is, or take --engine local");
  }
  if (outcome.timed_out) {
    throw Error(fmt::format("'{}' does not answer", words.front()), "--engine slurm",
                "try again when the controller is up", ErrorKind::kMachine);
  }
  // The last line may only say where help is.
  std::string why = data::LastLineOf(err);
  if (why.rfind("Try ", 0) == 0) why = Split(data::ReadTextFile(err), '\n').front();
  return {outcome.code, data::ReadTextFile(out), why};
}

// Of a job that has ended some versions say so as an error.
bool IsForgotten(const SlurmAnswer& answer) {
  return answer.err.find("Invalid job id") != std::string::npos;
}

[[noreturn]] void Refuse(const std::string& program, const SlurmAnswer& answer,
                         const std::string& remedy) {
  throw Error(program + " refuses: " + answer.err, "--engine slurm", remedy, ErrorKind::kMachine);
}

}  // namespace

std::uint64_t MaxArraySize() {
  const SlurmAnswer answer = Ask({"scontrol", "show", "config"});
  for (const std::string& line : Split(answer.out, '\n')) {
    const std::size_t equals = line.find('=');
    std::uint64_t value = 0;
    if (equals != std::string::npos &&
        Trim(std::string_view(line).substr(0, equals)) == "MaxArraySize" &&
        ParseWhole(Trim(std::string_view(line).substr(equals + 1)), &value) && value > 1) {
      return value;
    }
  }
  return kDefaultArraySize;
}

std::vector<SlurmTask> SlurmQueue(const std::vector<std::string>& jobs) {
  std::vector<SlurmTask> out;
  for (const std::string& job : jobs) {
    const SlurmAnswer answer = Ask({"squeue", "-h", "-r", "-j", job, "-o", "%T %F %K"});
    if (answer.code != 0 && !IsForgotten(answer)) Refuse("squeue", answer, "try again");
    for (const std::string& line : Split(answer.out, '\n')) {
      const std::vector<std::string> words = Split(std::string(Trim(line)), ' ');
      SlurmTask task;
      if (words.size() != 3) continue;
      task.state = words[0];
      task.job = words[1];
      if (ParseWhole(words[2], &task.task)) out.push_back(std::move(task));
    }
  }
  return out;
}

std::string SubmitArray(const SlurmSubmission& s) {
  std::vector<std::string> words = {
      "sbatch",
      "--parsable",
      "--requeue",
      "--job-name=" + s.name,
      "--array=" + s.tasks,
      "--output=" + std::filesystem::absolute(s.log).string(),
      "--chdir=" + std::filesystem::current_path().string(),
      "--export=ALL" + (s.exported.empty() ? std::string() : "," + s.exported)};
  words.insert(words.end(), s.options.begin(), s.options.end());
  words.push_back(s.script);
  const SlurmAnswer answer = Ask(words);
  std::string id = Split(std::string(Trim(answer.out)), ';').front();
  if (answer.code != 0 || id.empty()) Refuse("sbatch", answer, "look at the options for sbatch");
  return id;
}

void CancelJobs(const std::vector<std::string>& jobs) {
  if (jobs.empty()) return;
  std::vector<std::string> words = {"scancel"};
  words.insert(words.end(), jobs.begin(), jobs.end());
  const SlurmAnswer answer = Ask(words);
  if (answer.code != 0 && !IsForgotten(answer)) Refuse("scancel", answer, "try again");
}

std::string ShellQuoted(const std::string& text) {
  std::string copy = text;
  data::ReplaceAll(&copy, "'", "'\\''");
  return "'" + copy + "'";
}

std::string ArrayText(const std::vector<std::uint64_t>& tasks) {
  std::string out;
  for (std::size_t i = 0; i < tasks.size();) {
    std::size_t last = i;
    while (last + 1 < tasks.size() && tasks[last + 1] == tasks[last] + 1) ++last;
    if (!out.empty()) out += ",";
    out += last == i ? fmt::format("{}", tasks[i]) : fmt::format("{}-{}", tasks[i], tasks[last]);
    i = last + 1;
  }
  return out;
}

}  // namespace unfurl::campaign
