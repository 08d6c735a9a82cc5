#include "study/cost_bench.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/cpu_time.h"
#include "base/error.h"
#include "base/progress.h"
#include "base/statistics.h"
#include "sim/implicit/find_modes.h"
#include "sim/record/record.h"

namespace unfurl::study {
namespace {

// Runs are repeated until their median is known so well: two that differ by a seventh are then told
// apart (2 sqrt(2) standard errors).
constexpr double kKnownTo = 0.05;
constexpr int kFewestRuns = 3, kMostRuns = 25;
constexpr double kMedianOverMean = 1.2533;  // of their standard errors: sqrt(pi / 2)

// Ends a run that has had its time.
class TimeLimit : public sim::Observer {
 public:
  TimeLimit(double limit, double end)
      : end_of_thread_(CpuSeconds(CLOCK_THREAD_CPUTIME_ID) + limit), end_(end) {}
  void OnProgress(double /*fraction*/) override {
    if (CpuSeconds(CLOCK_THREAD_CPUTIME_ID) <= end_of_thread_ && CpuSeconds() <= end_) return;
    stopped_ = true;
    throw Interrupted();
  }
  bool stopped() const { return stopped_; }

 private:
  double end_of_thread_, end_;  // [s]
  bool stopped_ = false;
};

// Latches, and every crossing of a watched level, by name and number.
CostEvents EventsOf(const data::Run& run) {
  CostEvents out;
  std::map<std::string, int> seen;
  for (const data::RunEvent& e : run.events) {
    if (e.kind != "latch" && e.kind != "watch") continue;
    const std::string name = e.kind + " " + e.where;
    out.emplace_back(fmt::format("{} {}", name, ++seen[name]), e.t);
  }
  return out;
}

CostValues NumberOf(const data::Run& run, const CostEvents& events, const std::string& name) {
  const auto found = run.summary.find(name);
  if (found != run.summary.end()) {
    if (!std::isfinite(found->second)) return {};
    return {{found->second}, {}};
  }
  constexpr char kTime[] = ".time";
  if (!name.ends_with(kTime)) return {};
  const std::string event = "watch " + name.substr(0, name.size() - (sizeof kTime - 1)) + " 1";
  for (const auto& [known, t] : events) {
    if (known == event) return {{t}, {}};
  }
  return {};
}

}  // namespace

CostBench::CostBench(const data::Scene& scene, std::vector<CostQuantity> quantities,
                     double duration, int samples, double end)
    : scene_(scene),
      quantities_(std::move(quantities)),
      duration_(duration),
      samples_(samples),
      end_(end) {
  for (const CostQuantity& q : quantities_) {
    for (const std::string& column : q.Columns()) columns_.push_back(column);
    modes_ = std::max(modes_, q.mode);
  }
  if (columns_.empty()) columns_.emplace_back("energy.kinetic");  // none would mean all
}

bool CostBench::Over() const { return CpuSeconds() > end_; }

CostValues CostBench::Frequency(const CostMesh& mesh, int mode) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  auto [at, is_new] = frequencies_.try_emplace(mesh.words);
  if (is_new) {
    sim::ModesOptions options;
    options.count = modes_;
    options.mesh_error = false;  // the meshes are compared here
    try {
      const sim::SceneModes modes = sim::FindModes(mesh.Of(scene_), options);
      for (const data::ModesRecord::Mode& m : modes.record.modes) {
        if (modes.usable) at->second.push_back(m.frequency);
      }
    } catch (const Error& e) {
      frequency_problem_ = e.problem();
    }
  }
  const auto k = static_cast<std::size_t>(mode - 1);
  return k < at->second.size() ? CostValues{{at->second[k]}, {}} : CostValues{};
}

std::string CostBench::FrequencyProblem() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return frequency_problem_;
}

void CostBench::Once(const CostMesh& mesh, const std::string& method, double rtol, double limit,
                     CostOutcome* out) const {
  TimeLimit time(limit, end_);
  sim::RecordOptions options;
  options.simulate = sim::SimulateOptions();
  options.simulate->method = sim::MethodOf(method);
  options.simulate->rtol = rtol;
  options.simulate->duration = duration_;
  options.simulate->rate = samples_ / duration_;
  options.quantities = columns_;
  options.shape_rate = 0.0;
  options.observer = &time;
  const auto model = sim::CompileModel(mesh.Of(scene_));
  const double start = CpuSeconds(CLOCK_THREAD_CPUTIME_ID);
  sim::Recording run = sim::Record(model, options);
  out->seconds = CpuSeconds(CLOCK_THREAD_CPUTIME_ID) - start;
  if (run.status == "interrupted" && !time.stopped()) throw Interrupted();
  out->stopped = time.stopped();
  out->usable = run.Usable();
  out->message = out->stopped ? fmt::format("stopped after {:.2g} s", out->seconds) : run.message;
  if (!out->usable || !out->values.empty()) return;
  out->events = EventsOf(run.run);
  for (const CostQuantity& q : quantities_) {
    CostValues values;
    if (q.kind == CostQuantity::Kind::kNumber) {
      values = NumberOf(run.run, out->events, q.name);
    } else if (q.kind == CostQuantity::Kind::kFrequency) {
      values = Frequency(mesh, q.mode);
    } else {
      const std::vector<std::string> columns = q.Columns();
      values.a = run.run.Column(columns[0]);
      if (columns.size() > 1) values.b = run.run.Column(columns[1]);
    }
    out->values.push_back(std::move(values));
  }
}

CostOutcome CostBench::Run(const CostMesh& mesh, const std::string& method, double rtol,
                           const Effort& effort) const {
  CostOutcome out;
  std::vector<double> seconds;
  double sum = 0.0;
  try {
    do {
      Once(mesh, method, rtol, effort.limit, &out);
      if (!out.usable && !seconds.empty()) {  // a repeat that the budget ended
        out.usable = true;
        out.message.clear();
        break;
      }
      seconds.push_back(out.seconds);
      sum += out.seconds;
      const auto n = static_cast<double>(seconds.size());
      out.scatter = seconds.size() > 1 ? kMedianOverMean * std::sqrt(Variance(seconds) / n) : 0.0;
      const bool known = static_cast<int>(seconds.size()) >= kFewestRuns &&
                         out.scatter <= kKnownTo * Median(seconds);
      if (known || static_cast<int>(seconds.size()) >= kMostRuns) break;
    } while (out.usable && sum + seconds.back() <= effort.repeats && !Over());
  } catch (const Error& e) {  // a method that does not take the scene
    if (e.kind() == ErrorKind::kMachine) throw;
    out.usable = false;
    out.refused = true;
    out.message = e.problem();
  }
  out.runs = static_cast<int>(seconds.size());
  if (!seconds.empty()) out.seconds = Median(seconds);
  return out;
}

CostValues CostBench::OnClock(const CostOutcome& outcome, std::size_t quantity,
                              const CostEvents& clock) const {
  CostValues values = outcome.values[quantity];
  if (!quantities_[quantity].jumps) return values;
  values.a = FromEventToEvent(values.a, duration_ / samples_, outcome.events, clock);
  return values;
}

}  // namespace unfurl::study
