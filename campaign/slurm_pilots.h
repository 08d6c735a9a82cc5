#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "campaign/evaluation_folder.h"

namespace unfurl::campaign {

/// Jobs of Slurm that serve a fit's folder of questions: one array whose tasks wait in the queue
/// once and then answer question after question.
class SlurmPilots {
 public:
  /// Hands over `count` tasks that run `words`. Throws Error where Slurm is not there or refuses.
  SlurmPilots(const EvaluationFolder& folder, const std::vector<std::string>& words,
              std::size_t count, std::vector<std::string> options);
  /// Ends them.
  ~SlurmPilots();
  SlurmPilots(const SlurmPilots&) = delete;
  SlurmPilots& operator=(const SlurmPilots&) = delete;

  /// To be called every few seconds with the number of answers so far: hands over another array
  /// where all tasks have ended, as their time limits may have them. Throws Error(kMachine) where
  /// arrays end one after another without an answer.
  void Watch(std::uint64_t answers);

 private:
  void Submit();

  const EvaluationFolder& folder_;
  std::string script_;
  std::size_t count_;
  std::vector<std::string> options_;
  std::vector<std::string> jobs_;
  double looked_ = 0.0;                  // when [s]
  std::uint64_t answers_at_submit_ = 0;
  int rounds_ = 0;                       // arrays in a row without an answer
};

}  // namespace unfurl::campaign
