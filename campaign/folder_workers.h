#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "campaign/evaluation_folder.h"
#include "correlate/fit/workers.h"

namespace unfurl::campaign {

/// Says again every few seconds that somebody lives, from a thread of its own, until it goes.
class Heart {
 public:
  explicit Heart(std::function<void()> beat);
  ~Heart();
  Heart(const Heart&) = delete;
  Heart& operator=(const Heart&) = delete;

 private:
  std::function<void()> beat_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool ended_ = false;
  std::thread thread_;
};

/// Evaluations of a fit carried out by whoever serves a folder (ServeEvaluations): the same bits as
/// by threads. For evaluations of a second and more.
class FolderWorkers : public correlate::Workers {
 public:
  /// `problems`: those that are fitted, which must outlive this; the server has the same in the
  /// same order. `watch` is called every few seconds while questions are open, with the number of
  /// answers so far, by one thread at a time; it may throw.
  FolderWorkers(EvaluationFolder folder, std::vector<const correlate::FitProblem*> problems,
                std::function<void(std::uint64_t)> watch);
  ~FolderWorkers() override;

  void Run(std::span<const correlate::Job> jobs,
           const std::function<void(std::size_t, correlate::Prediction)>& done) override;

  std::uint64_t answers() const { return answers_; }  ///< so far
  /// Of an answer's computing, by the server's clock [s]; 0: there is none yet.
  double MeanSeconds() const;

 private:
  // A question that waits for its answer.
  struct Open {
    std::size_t job = 0;  // of the batch
    std::string bytes;
  };
  std::string BytesOf(const correlate::Job& job) const;
  bool Read(std::uint64_t question, const Open& open, correlate::Prediction* answer);
  void Watch();

  EvaluationFolder folder_;
  std::vector<const correlate::FitProblem*> problems_;
  std::function<void(std::uint64_t)> watch_;
  std::atomic<std::uint64_t> next_, answers_ = 0;
  std::atomic<double> seconds_ = 0.0;
  std::mutex watching_;
  double watched_ = 0.0;                  // when [s]
  std::map<std::uint64_t, int> asked_;    // questions that were asked again: how often
  std::atomic<bool> failed_ = false;
  Heart heart_;
};

/// Answers what a fit asks, until it has ended: `count` evaluations at a time (0: one per core).
/// Returns how many. Throws Error for a damaged question, Interrupted.
std::uint64_t ServeEvaluations(const EvaluationFolder& folder,
                               const std::vector<const correlate::FitProblem*>& problems,
                               std::size_t count);

}  // namespace unfurl::campaign
