#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace unfurl::campaign {

// What this program asks of Slurm, by its own commands. Each throws Error(kMachine) where Slurm
// refuses or does not answer, and Error where it is not installed.

/// A task of an array that Slurm has in its queue.
struct SlurmTask {
  std::string state;       ///< "RUNNING", "PENDING"
  std::string job;         ///< of the array
  std::uint64_t task = 0;  ///< its index in it
};
/// Of these jobs, what waits or runs; nothing of jobs that Slurm has forgotten.
std::vector<SlurmTask> SlurmQueue(const std::vector<std::string>& jobs);

/// Indices of an array's tasks are below this.
std::uint64_t MaxArraySize();

/// A job array to be handed over.
struct SlurmSubmission {
  std::string name;                  ///< that the queue shows
  std::string script;                ///< path
  std::string tasks;                 ///< "1-7,9"
  std::string log;                   ///< path of the tasks' output; %A, %a stand for job and task
  std::string exported;              ///< "NAME=value" for the tasks; empty: none
  std::vector<std::string> options;  ///< the user's own, of sbatch
};
/// The job's number.
std::string SubmitArray(const SlurmSubmission& submission);

/// Ends these jobs, as far as they have not ended.
void CancelJobs(const std::vector<std::string>& jobs);

/// As one word of a shell.
std::string ShellQuoted(const std::string& text);

/// "1-5,8,10-11" for 1, 2, 3, 4, 5, 8, 10, 11: as sbatch wants it.
std::string ArrayText(const std::vector<std::uint64_t>& tasks);

}  // namespace unfurl::campaign
