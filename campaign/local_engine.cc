#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <deque>
#include <filesystem>
#include <mutex>

#include "base/cpu_time.h"
#include "base/error.h"
#include "base/subprocess.h"
#include "base/worker_pool.h"
#include "campaign/engine.h"
#include "data/scratch_folder.h"

namespace unfurl::campaign {

namespace {

// Long beside the start of a process (a tenth of a second), short beside a cup of coffee. At the
// end parts get shorter, but not below where starting processes would cost a twentieth.
constexpr double kPartSeconds = 5.0, kShortPart = 2.0;
// A process that is killed from outside is begun again so often; then the machine is at fault.
constexpr int kMostKills = 3;
constexpr double kNoLimit = 1e9;  // of a process [s]: a run has a limit of its own
constexpr int kFromSignal = 128;  // exit codes above it: by a signal
constexpr int kTerminated = 143;  // 128 + SIGTERM

// What there is to compute, handed out in parts whose length follows from those that are done.
class Queue {
 public:
  Queue(const CampaignFolder& folder, std::uint64_t runs, std::size_t workers,
        const EngineOptions& options)
      : workers_(workers),
        budget_(options.budget),
        most_(options.most),
        mean_(options.mean),
        start_(WallSeconds()) {
    for (const RunRange& range : folder.Missing(runs)) {
      open_.push_back({range, 0});
      left_ += range.count;
    }
    done_ = runs - left_;
  }

  struct Task {
    RunRange range;
    int kills = 0;
    bool whole = false;  // tried before: as it is, or in halves
  };

  bool Next(Task* task) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (open_.empty()) return false;
    if (budget_ > 0.0 && runs_ > 0 && WallSeconds() - start_ > budget_) return false;
    if (most_ > 0 && handed_ >= most_) return false;
    Task& front = open_.front();
    if (front.whole) {
      *task = front;
      open_.pop_front();
      return true;
    }
    std::uint64_t count = std::min(front.range.count, Length());
    if (most_ > 0) count = std::min(count, most_ - handed_);
    handed_ += count;
    *task = {{front.range.first, count}, 0, true};
    front.range = {front.range.first + count, front.range.count - count};
    if (front.range.count == 0) open_.pop_front();
    return true;
  }

  void Again(const Task& task) {
    const std::lock_guard<std::mutex> lock(mutex_);
    open_.push_front(task);
  }

  // Returns runs done so far.
  std::uint64_t Done(const Task& task, double seconds) {
    const std::lock_guard<std::mutex> lock(mutex_);
    seconds_ += seconds;
    runs_ += task.range.count;
    left_ -= task.range.count;
    done_ += task.range.count;
    ++parts_;
    return done_;
  }

  EngineReport Report() const { return {parts_, seconds_, runs_, 0}; }

 private:
  // The first parts are one run each; the last ones short, so that all end together.
  std::uint64_t Length() const {
    if (runs_ == 0 && mean_ <= 0.0) return 1;
    const double known = runs_ == 0 ? mean_ : seconds_ / static_cast<double>(runs_);
    const double mean = std::max(known, 1e-9);
    const double fair = static_cast<double>(left_) / (2.0 * static_cast<double>(workers_));
    const double length = std::clamp(fair, kShortPart / mean, kPartSeconds / mean);
    return static_cast<std::uint64_t>(std::max(1.0, length));
  }

  std::size_t workers_;
  double budget_;
  std::uint64_t most_;
  double mean_, start_;
  mutable std::mutex mutex_;
  std::deque<Task> open_;
  std::uint64_t left_ = 0, done_ = 0, runs_ = 0, parts_ = 0, handed_ = 0;
  double seconds_ = 0.0;
};

class Engine {
 public:
  Engine(const CampaignFolder& folder, std::uint64_t runs, const EngineOptions& options)
      : folder_(folder),
        options_(options),
        responses_(folder.ReadPlan().responses.size()),
        workers_(WorkerCount(options.workers)),
        queue_(folder, runs, workers_, options) {}

  EngineReport Run() {
    ParallelFor(workers_, workers_, [&](std::size_t) {
      Queue::Task task;
      while (queue_.Next(&task)) Compute(task);
    });
    EngineReport report = queue_.Report();
    report.crashed = crashed_;
    return report;
  }

 private:
  void Compute(const Queue::Task& task) {
    const double start = WallSeconds();
    const std::string name = fmt::format("{}-{}", task.range.first, task.range.end()),
                      out = folder_.LogPath(name + ".out"), err = folder_.LogPath(name + ".err");
    std::vector<std::string> words = {options_.program,      "campaign", folder_.path(), "--rows",
                                      RangeText(task.range), "--quiet"};
    if (options_.allow_programs) words.emplace_back("--allow-programs");
    const ProgramOutcome outcome =
        RunProgram(words, std::filesystem::current_path().string(), out, err, kNoLimit);
    if (outcome.code == kExitGood) {
      std::error_code ignored;
      std::filesystem::remove(out, ignored);
      std::filesystem::remove(err, ignored);
      // By its own account, without the start of the process; and whole, as reading it shows.
      const Part part = ReadPart(folder_.PartPath(task.range), folder_.identity(), responses_);
      Tell(queue_.Done(task, part.wall_seconds));
      return;
    }
    if (outcome.code == kExitInterrupted || outcome.code == kTerminated) throw Interrupted();
    const std::string last = data::LastLineOf(err);
    if (!outcome.started) {
      throw Error("does not start", options_.program, "install it again", ErrorKind::kMachine);
    }
    if (outcome.code == kExitBadInput || outcome.code == kExitMachine) {
      throw Error("its runs ended with: " + last, folder_.path(),
                  "mend that; what is done so far is kept",
                  outcome.code == kExitMachine ? ErrorKind::kMachine : ErrorKind::kBadInput);
    }
    Fault(task, outcome.code, WallSeconds() - start);
  }

  // The process did not end by itself.
  void Fault(Queue::Task task, int code, double seconds) {
    if (code == kFromSignal + SIGKILL) {
      if (++task.kills > kMostKills) {
        throw Error(fmt::format("runs {} were killed {} times", RangeText(task.range), task.kills),
                    folder_.path(), "look whether memory suffices; what is done so far is kept",
                    ErrorKind::kMachine);
      }
      queue_.Again(task);
    } else if (task.range.count > 1) {
      const std::uint64_t half = task.range.count / 2;
      queue_.Again({{task.range.first + half, task.range.count - half}, 0, true});
      queue_.Again({{task.range.first, half}, 0, true});
    } else {
      const std::string why = code > kFromSignal
                                  ? fmt::format("ends the program by signal {}", code - kFromSignal)
                                  : fmt::format("ends the program with code {}", code);
      WritePart(folder_.PartPath(task.range), FailedPart(task.range, responses_, why),
                folder_.identity(), responses_);
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        ++crashed_;
      }
      Tell(queue_.Done(task, seconds));
    }
  }

  void Tell(std::uint64_t done) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (options_.progress) options_.progress(done);
  }

  const CampaignFolder& folder_;
  const EngineOptions& options_;
  std::size_t responses_;
  std::size_t workers_;
  Queue queue_;
  std::mutex mutex_;
  std::uint64_t crashed_ = 0;
};

}  // namespace

EngineReport RunLocally(const CampaignFolder& folder, std::uint64_t runs,
                        const EngineOptions& options) {
  return Engine(folder, runs, options).Run();
}

}  // namespace unfurl::campaign
