#include "campaign/folder_workers.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstring>

#include "base/cpu_time.h"
#include "base/error.h"
#include "base/progress.h"
#include "base/text.h"
#include "base/worker_pool.h"
#include "correlate/fit/evaluation_store.h"
#include "data/journal.h"

namespace unfurl::campaign {

namespace {

using correlate::Prediction;

constexpr std::chrono::seconds kBeatEvery{5};
// Some beats, and the lateness of a file system that machines share (it may show a file's time half
// a minute late) [s].
constexpr double kSilence = 60.0;
// Between looks into the folder: soon after something came, then less and less often.
constexpr std::chrono::milliseconds kSoon{10}, kSeldom{500};
constexpr double kWatch = 1.0;  // between looks for dead workers [s]
// A question whose workers have died so often is not asked again: it is what kills them.
constexpr int kMostDeaths = 3;

// Waits longer from time to time, in small steps that see Ctrl-C.
class Patience {
 public:
  void Wait() {
    ThrowIfInterrupted();
    std::this_thread::sleep_for(wait_);
    wait_ = std::min(2 * wait_, kSeldom);
  }
  void Reset() { wait_ = kSoon; }

 private:
  std::chrono::milliseconds wait_ = kSoon;
};

template <typename T>
void PutNumber(std::string* out, T value) {
  out->append(reinterpret_cast<const char*>(&value), sizeof value);
}

template <typename T>
bool TakeNumber(std::string_view* from, T* value) {
  if (from->size() < sizeof *value) return false;
  std::memcpy(value, from->data(), sizeof *value);
  from->remove_prefix(sizeof *value);
  return true;
}

// Null: the trial has none.
const correlate::Model* ModelOrNull(const correlate::FitTrial& trial,
                                    correlate::Fidelity fidelity) {
  const auto first = static_cast<std::int64_t>(correlate::Fidelity::kRung);
  const std::int64_t rung = static_cast<std::int64_t>(fidelity) - first;
  if (rung >= static_cast<std::int64_t>(trial.rungs.size())) return nullptr;
  return correlate::ModelOf(trial, fidelity);
}

Prediction AnswerTo(const std::vector<const correlate::FitProblem*>& problems,
                    const std::string& bytes, std::uint64_t number) {
  std::string_view from = bytes;
  std::uint64_t problem = 0;
  correlate::StoredQuestion asked;
  const bool whole = TakeNumber(&from, &problem) && correlate::ParseQuestion(from, &asked);
  const correlate::Model* model = nullptr;
  if (whole && problem < problems.size() && asked.trial < problems[problem]->trials.size()) {
    model = ModelOrNull(problems[problem]->trials[asked.trial], asked.fidelity);
  }
  if (model == nullptr) {
    throw Error(fmt::format("question {} is of no model of this study", number), "--serve",
                "use one version of this program for the fit and its workers", ErrorKind::kMachine);
  }
  return correlate::EvaluateChecked(*model, asked.theta, asked.stamps);
}

// Numbers of a fit that is begun later are higher: a late answer of an earlier one is not mistaken.
std::uint64_t FirstNumber() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return static_cast<std::uint64_t>(
      std::chrono::duration_cast<std::chrono::milliseconds>(now).count());
}

}  // namespace

Heart::Heart(std::function<void()> beat)
    : beat_(std::move(beat)), thread_([this] {
        std::unique_lock<std::mutex> lock(mutex_);
        while (!ended_) {
          beat_();
          wake_.wait_for(lock, kBeatEvery, [this] { return ended_; });
        }
      }) {}

Heart::~Heart() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ended_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

FolderWorkers::FolderWorkers(EvaluationFolder folder,
                             std::vector<const correlate::FitProblem*> problems,
                             std::function<void(std::uint64_t)> watch)
    : folder_(std::move(folder)),
      problems_(std::move(problems)),
      watch_(std::move(watch)),
      next_(FirstNumber()),
      heart_([this] { folder_.Beat(); }) {}

FolderWorkers::~FolderWorkers() = default;

double FolderWorkers::MeanSeconds() const {
  return answers_ == 0 ? 0.0 : seconds_ / static_cast<double>(answers_.load());
}

std::string FolderWorkers::BytesOf(const correlate::Job& job) const {
  for (std::size_t i = 0; i < problems_.size(); ++i) {
    const auto& trials = problems_[i]->trials;
    if (job.trial >= trials.size() || ModelOrNull(trials[job.trial], job.fidelity) != job.model) {
      continue;
    }
    std::string bytes;
    PutNumber(&bytes, static_cast<std::uint64_t>(i));
    return bytes + correlate::WholeQuestionBytes(job);
  }
  throw Error("a model that is none of the fit's", "--engine",
              "this is a fault of this program: report it", ErrorKind::kMachine);
}

void FolderWorkers::Watch() {
  const std::unique_lock<std::mutex> lock(watching_, std::try_to_lock);
  if (!lock || WallSeconds() - watched_ < kWatch) return;
  watched_ = WallSeconds();
  for (const std::uint64_t question : folder_.AskAgain(kSilence)) {
    if (++asked_[question] < kMostDeaths) continue;
    failed_ = true;
    throw Error(fmt::format("{} workers died of one evaluation", kMostDeaths), folder_.path(),
                "look at their logs, and at memory; then --resume", ErrorKind::kMachine);
  }
  if (watch_) watch_(answers_);
}

// False: it is not there yet.
bool FolderWorkers::Read(std::uint64_t question, const Open& open, Prediction* answer) {
  std::string bytes;
  if (!folder_.Fetch(question, &bytes)) return false;
  std::string_view from = bytes;
  std::uint64_t asked = 0;
  double seconds = 0.0;
  if (!TakeNumber(&from, &asked) || !TakeNumber(&from, &seconds) ||
      !correlate::ParseAnswer(from, answer)) {
    throw Error(fmt::format("answer {} is none", question), folder_.path(),
                "use one version of this program for the fit and its workers", ErrorKind::kMachine);
  }
  if (asked != data::Checksum(open.bytes)) {  // of a fit that had this folder before
    *answer = {};
    folder_.Ask(question, open.bytes);
    return false;
  }
  seconds_ = seconds_ + seconds;
  ++answers_;
  return true;
}

void FolderWorkers::Run(std::span<const correlate::Job> jobs,
                        const std::function<void(std::size_t, Prediction)>& done) {
  std::map<std::uint64_t, Open> open;
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const std::uint64_t question = next_++;
    const Open& one = open[question] = {i, BytesOf(jobs[i])};
    folder_.Ask(question, one.bytes);
  }
  Patience patience;
  while (!open.empty()) {
    for (auto it = open.begin(); it != open.end();) {
      Prediction answer;
      if (!Read(it->first, it->second, &answer)) {
        ++it;
        continue;
      }
      done(it->second.job, std::move(answer));
      it = open.erase(it);
      patience.Reset();
    }
    if (open.empty()) return;
    if (failed_) throw Error("its workers died", folder_.path(), "see there", ErrorKind::kMachine);
    Watch();
    patience.Wait();
  }
}

std::uint64_t ServeEvaluations(const EvaluationFolder& folder,
                               const std::vector<const correlate::FitProblem*>& problems,
                               std::size_t count) {
  const std::size_t threads = WorkerCount(count);
  std::atomic<std::uint64_t> answered = 0;
  ParallelFor(threads, threads, [&](std::size_t thread) {
    const std::string worker = fmt::format("{}-{}", ProcessName(), thread);
    Patience patience;
    while (!folder.IsLeft(kSilence)) {
      std::uint64_t question = 0;
      std::string bytes;
      if (!folder.Take(worker, &question, &bytes)) {
        patience.Wait();
        continue;
      }
      const Heart heart([&] { folder.Working(worker, question); });
      const double start = WallSeconds();
      const Prediction answer = AnswerTo(problems, bytes, question);
      std::string out;
      PutNumber(&out, data::Checksum(bytes));
      PutNumber(&out, WallSeconds() - start);
      folder.Answer(worker, question, out + correlate::AnswerBytes(answer));
      ++answered;
      patience.Reset();
    }
  });
  return answered;
}

}  // namespace unfurl::campaign
