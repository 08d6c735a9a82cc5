#include "sim/methods/simulate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/text.h"
#include "sim/dynamics/observables.h"
#include "sim/methods/choose_method.h"
#include "sim/methods/integration.h"

namespace unfurl::sim {
namespace {

class MarkCollector : public Observer {
 public:
  MarkCollector(const Model& model, MarkTracks* tracks, std::size_t samples)
      : model_(model), tracks_(tracks) {
    const std::size_t marks = model.marks.size();
    for (auto* columns : {&tracks->x, &tracks->y, &tracks->vx, &tracks->vy}) {
      columns->resize(marks);
      for (auto& column : *columns) column.reserve(samples);
    }
    tracks->t.reserve(samples);
  }
  void OnSample(double t, double* state, const std::vector<LatchMode>&) override {
    tracks_->t.push_back(t);
    for (std::size_t m = 0; m < model_.marks.size(); ++m) {
      const PointMotion p = MotionOf(model_, model_.marks[m].point, state);
      tracks_->x[m].push_back(p.x);
      tracks_->y[m].push_back(p.y);
      tracks_->vx[m].push_back(p.vx);
      tracks_->vy[m].push_back(p.vy);
    }
  }

 private:
  const Model& model_;
  MarkTracks* tracks_;
};

constexpr double kHighestRate = 1e7;  // of samples, data::ReadScene's too [1/s]

bool IsPositive(double v) { return v > 0.0 && std::isfinite(v); }
bool IsNotNegative(double v) { return v >= 0.0 && std::isfinite(v); }

[[noreturn]] void BadOption(const char* field, const std::string& what, const char* remedy) {
  throw Error(what, fmt::format("option {}", field), remedy);
}

}  // namespace

double DurationOf(const SimulateOptions& options, const Model& model) {
  return options.duration > 0.0 ? options.duration : model.duration;
}

double UsualRate(double duration) {
  constexpr double kUsual = 1000.0;    // [1/s]: tenfold what a deployment of seconds rings with
  constexpr double kSamples = 1000.0;  // as many as a chart has columns
  if (!(duration > 0.0) || duration * kUsual >= kSamples) return kUsual;
  const double least = kSamples / duration;
  const double decade = std::pow(10.0, std::floor(std::log10(least)));
  for (const double step : {1.0, 2.0, 5.0}) {
    constexpr double kRounding = 1.0 - 1e-9;  // of a duration that is written in decimals
    if (step * decade >= kRounding * least) return std::min(step * decade, kHighestRate);
  }
  return std::min(10.0 * decade, kHighestRate);
}

void SimulateOptions::Check() const {
  if (!(duration >= 0.0) || duration > 1e7) {
    BadOption("duration", fmt::format("{} s is not a duration", duration), "use 0 to 1e7 s");
  }
  if (!IsPositive(rate) || rate > kHighestRate) {
    BadOption("rate", fmt::format("{} is not a sampling rate", rate), "use up to 1e7 per second");
  }
  if (!(rtol >= 1e-13 && rtol <= 1e-2)) {
    BadOption("rtol", fmt::format("a tolerance of {} cannot be kept", rtol), "use 1e-13 to 1e-2");
  }
  if (!IsNotNegative(length)) {
    BadOption("length", fmt::format("{} is not a length", length), "use a positive number");
  }
  if (!IsNotNegative(time)) {
    BadOption("time", fmt::format("{} is not a time", time), "use a positive number, or 0");
  }
  if (!IsNotNegative(max_step)) {
    BadOption("max_step", fmt::format("{} is not a step", max_step), "use a positive number, or 0");
  }
  if (max_steps <= 0) BadOption("max_steps", "no steps allowed", "use a positive number");
  constexpr int kOrders[] = {0, 4, 5, 8};
  if (std::ranges::find(kOrders, order) == std::end(kOrders)) {
    BadOption("order", fmt::format("there is no pair of order {}", order), "use 4, 5, 8, or 0");
  }
  if (!IsPositive(drift_fraction)) {
    BadOption("drift_fraction", fmt::format("{} is not a fraction", drift_fraction), "use 0.1");
  }
}

const char* MethodName(Method method) {
  switch (method) {
    case Method::kProjected:
      return "projected";
    case Method::kPartitioned:
      return "partitioned";
    case Method::kImplicit:
      return "implicit";
    default:
      return "auto";
  }
}

Method MethodOf(const std::string& name) {
  constexpr Method kAll[] = {Method::kAuto, Method::kProjected, Method::kPartitioned,
                             Method::kImplicit};
  std::vector<std::string> known;
  for (const Method method : kAll) {
    if (name == MethodName(method)) return method;
    known.push_back(MethodName(method));
  }
  const std::string nearest = NearestName(name, known);
  throw Error(fmt::format("there is no method \"{}\"", name), "option method",
              nearest.empty() ? "use " + JoinWords(known) : "did you mean \"" + nearest + "\"?");
}

const char* StatusName(SimulateStatus status) {
  switch (status) {
    case SimulateStatus::kGood:
      return "good";
    case SimulateStatus::kStepTooSmall:
      return "step too small";
    case SimulateStatus::kNotFinite:
      return "not finite";
    case SimulateStatus::kSingular:
      return "dependent constraints";
    case SimulateStatus::kEnergy:
      return "energy not balanced";
    case SimulateStatus::kDrift:
      return "constraints drifted";
    case SimulateStatus::kMeshCoarse:
      return "mesh too coarse";
    case SimulateStatus::kCrushed:
      return "beam crushed";
    default:
      return "too many steps";
  }
}

const char* LimitName(StepLimit limit) {
  switch (limit) {
    case StepLimit::kError:
      return "error";
    case StepLimit::kStability:
      return "stability";
    case StepLimit::kGrowth:
      return "growth";
    case StepLimit::kMaxStep:
      return "max_step";
    case StepLimit::kContactExit:
      return "contact exit";
    case StepLimit::kEvent:
      return "event";
    case StepLimit::kEdge:
      return "function edge";
    case StepLimit::kFunction:
      return "function swing";
    default:
      return "end";
  }
}

SimulateReport Simulate(const Model& model, const SimulateOptions& options, Observer* observer) {
  options.Check();
  SimulateOptions scaled = options;
  if (scaled.length == 0.0) scaled.length = model.length_scale;
  if (scaled.time == 0.0) scaled.time = model.time_scale;
  scaled.max_step = LongestStep(scaled, model);
  return Integration(model, scaled, observer).Go();
}

MarkTracks SimulateMarks(const Model& model, SimulateOptions options) {
  options.Check();
  options.track_energy = options.track_forces = false;
  MarkTracks tracks;
  const double duration = DurationOf(options, model);
  MarkCollector collector(model, &tracks, static_cast<std::size_t>(duration * options.rate) + 2);
  tracks.report = Simulate(model, options, &collector);
  return tracks;
}

MarkTracks SimulateMarks(const data::Scene& scene, const SimulateOptions& options) {
  return SimulateMarks(Compile(scene), options);
}

std::shared_ptr<const Model> CompileModel(const data::Scene& scene) {
  return std::make_shared<const Model>(Compile(scene));
}

}  // namespace unfurl::sim
