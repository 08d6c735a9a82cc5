#include "campaign/slurm_pilots.h"

#include <fmt/format.h>

#include <filesystem>

#include "base/cpu_time.h"
#include "base/error.h"
#include "campaign/slurm.h"
#include "data/atomic_file.h"

namespace unfurl::campaign {

namespace {

constexpr double kLook = 10.0;  // between looks at the queue: controllers dislike more [s]
constexpr int kRounds = 3;      // arrays in a row that end without an answer

}  // namespace

SlurmPilots::SlurmPilots(const EvaluationFolder& folder, const std::vector<std::string>& words,
                         std::size_t count, std::vector<std::string> options)
    : folder_(folder),
      script_((std::filesystem::path(folder.path()) / "task.sh").string()),
      count_(count),
      options_(std::move(options)) {
  if (count_ == 0 || count_ >= MaxArraySize()) {
    throw Error(fmt::format("{} jobs are more than an array of this cluster holds", count_),
                "--workers", fmt::format("give 1 to {}", MaxArraySize() - 1));
  }
  std::string text = "#!/bin/bash\n# Written by `unfurl fit`: one of its workers.\nexec";
  for (const std::string& word : words) text += " " + ShellQuoted(word);
  data::WriteTextFile(script_, text + "\n");
  Submit();
}

SlurmPilots::~SlurmPilots() {
  try {
    CancelJobs(jobs_);
  } catch (const Error&) {  // they end by themselves when the folder is gone
  }
}

void SlurmPilots::Submit() {
  jobs_ = {SubmitArray({"unfurl-fit", script_, fmt::format("1-{}", count_),
                        folder_.LogPath("%A_%a"), "", options_})};
}

void SlurmPilots::Watch(std::uint64_t answers) {
  if (WallSeconds() - looked_ < kLook) return;
  looked_ = WallSeconds();
  if (!SlurmQueue(jobs_).empty()) return;
  rounds_ = answers > answers_at_submit_ ? 0 : rounds_ + 1;
  if (rounds_ >= kRounds) {
    throw Error(fmt::format("{} arrays of workers ended without an answer", kRounds),
                folder_.LogPath("*"), "look at what they say there; then --resume",
                ErrorKind::kMachine);
  }
  answers_at_submit_ = answers;
  Submit();
}

}  // namespace unfurl::campaign
