#include "sim/simulate.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>

#include "base/error.h"
#include "base/progress.h"
#include "base/text.h"
#include "sim/dormand_prince.h"
#include "sim/flush_denormals.h"
#include "sim/observables.h"

namespace unfurl::sim {
namespace {

// Controller of Hairer, Norsett and Wanner (Solving ODEs I, II.4), with memory against the
// oscillation of steps that stability limits.
constexpr double kSafety = 0.9, kMemory = 0.2;  // memory times the order
constexpr double kMostGrowth = 5.0, kMostShrink = 0.2;
constexpr double kFirstStep = 1e-6;      // [s]; grows fivefold per step from there
constexpr double kSmallestStep = 1e-15;  // relative to the time reached, or to 1 s
constexpr double kSingularPivot = 1e-12;
constexpr double kZonePart = 0.25;  // of a contact's transition zone, per step on the way out
constexpr int kPollSteps = 512;     // between looks at Ctrl-C, pivots and progress

std::unique_ptr<Stepper> MakeStepper(Method, Dynamics& dynamics, const ErrorScale& scale) {
  return std::make_unique<DormandPrince>(dynamics, scale);
}

class Run {
 public:
  Run(const Model& model, const SimulateOptions& options, Observer* observer)
      : model_(model),
        options_(options),
        observer_(observer),
        dynamics_(model),
        scale_(Scale(model, options)),
        stepper_(MakeStepper(options.method, dynamics_, scale_)),
        finder_(model),
        sample_(model.index.size(), 0.0),
        end_(options.duration > 0.0 ? options.duration : model.duration),
        exponent_((1.0 - 0.75 * kMemory) / stepper_->ErrorOrder()),
        memory_(kMemory / stepper_->ErrorOrder()),
        zone_part_(kZonePart * std::min(2.0, std::pow(options.rtol / 1e-6, 0.2))) {
    dynamics_.track_energy = options.track_energy;
    report_.peak_moment.assign(model.latches.count(), 0.0);
    report_.peak_time.assign(model.latches.count(), 0.0);
    if (options.profile) dynamics_.profile = &report_.part_seconds;
  }

  SimulateReport Go() {
    const FlushDenormals flush;
    const auto begin = std::chrono::steady_clock::now();
    stepper_->Start(0.0, model_.initial_state);
    CorrectDrift();
    SampleNow();
    double h = std::min(kFirstStep, options_.max_step);
    double last_error = 1e-4;
    while (t_ < end_ && report_.status == SimulateStatus::kGood) {
      const bool last = t_ + h >= end_ * (1.0 - 1e-15);
      if (last) h = end_ - t_;
      const double error = stepper_->Try(h);
      if (!(error <= 1.0)) {
        ++report_.rejected;
        Shrink(error, &h);
        continue;
      }
      Advance(h, last);
      double factor =
          std::pow(std::max(error, 1e-10), exponent_) / std::pow(last_error, memory_) / kSafety;
      factor = std::clamp(factor, 1.0 / kMostGrowth, 1.0 / kMostShrink);
      last_error = std::max(error, 1e-4);
      h = std::min({h / factor, options_.max_step, ContactStep()});
      if (++report_.steps % kPollSteps == 0) Poll();
    }
    report_.t_end = t_;
    report_.method = stepper_->name();
    report_.evaluations = stepper_->evaluations();
    report_.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return std::move(report_);
  }

 private:
  static ErrorScale Scale(const Model& model, const SimulateOptions& o) {
    ErrorScale scale;
    scale.rtol = o.rtol;
    scale.length = o.length > 0.0 ? o.length : model.length_scale;
    scale.angle = 1.0;
    scale.speed = scale.length / o.time;
    scale.spin = 1.0 / o.time;
    if (o.track_energy) {
      std::vector<double> start = model.initial_state;
      const Balance b = Dynamics(model).BalanceAt(0.0, start.data());
      scale.energy = b.kinetic + b.bending + b.axial + b.spring + b.suspension + b.contact;
    }
    return scale;
  }

  void Shrink(double error, double* h) {
    const double factor =
        std::isfinite(error)
            ? std::max(kMostShrink, kSafety * std::pow(error, -1.0 / stepper_->ErrorOrder()))
            : 0.1;
    *h *= factor;
    if (*h > kSmallestStep * std::max(t_, 1.0)) return;
    std::string where;
    if (dynamics_.SmallestPivot(&where) < kSingularPivot) {
      Fail(SimulateStatus::kSingular,
           fmt::format("the constraints became dependent at '{}'", where));
    } else {
      Fail(std::isfinite(error) ? SimulateStatus::kStepTooSmall : SimulateStatus::kNotFinite,
           fmt::format("the step shrank to {:.1e} s, worst at {}", *h,
                       NameOfSlot(model_, stepper_->WorstSlot())));
    }
  }

  void Fail(SimulateStatus status, const std::string& what) {
    report_.status = status;
    report_.message = fmt::format("{}, at t = {:.9g} s", what, t_);
  }

  // The tried step is good: sample it, and accept it, up to the first event in it.
  void Advance(double h, bool last) {
    double sigma = 1.0;
    const bool event =
        model_.latches.count() > 0 && finder_.FindFirst(*stepper_, dynamics_.modes(), &sigma);
    const double t_new = event ? t_ + sigma * h : last ? end_ : t_ + h;
    SampleStep(h, t_new);
    t_ = t_new;
    if (!event) {
      stepper_->Accept(t_);
      CorrectDrift();
      WatchPeaks();
      return;
    }
    stepper_->AcceptUntil(sigma, t_);
    const std::size_t before = report_.events.size();
    finder_.Apply(stepper_->state(), t_, &dynamics_.modes(), &report_.events);
    if (observer_ != nullptr) {
      for (std::size_t k = before; k < report_.events.size(); ++k) {
        observer_->OnEvent(report_.events[k]);
      }
    }
    stepper_->Refresh();
    CorrectDrift();
  }

  // The factor of the last right side, at the state, serves to bring the constraints back.
  void CorrectDrift() {
    if (model_.constraints.count() == 0) return;
    const double length = options_.rtol * scale_.length, speed = options_.rtol * scale_.speed;
    const double position = dynamics_.PositionDrift(t_, stepper_->state());
    const double velocity = dynamics_.VelocityDrift(t_, stepper_->state());
    report_.largest_position_drift = std::max(report_.largest_position_drift, position);
    report_.largest_velocity_drift = std::max(report_.largest_velocity_drift, velocity);
    if (position <= options_.drift_fraction * length &&
        velocity <= options_.drift_fraction * speed) {
      return;
    }
    dynamics_.Project(t_, stepper_->state());
    stepper_->Refresh();
    ++report_.projections;
  }

  // The longest step that does not leap over the end of a contact. Where f is held at zero nothing
  // slows the steps down, and yet f comes back for an instant in the transition zone
  // (delta < epsilon), between two stages of a long step.
  double ContactStep() const {
    double longest = options_.max_step;
    for (int k = 0; k < model_.latches.count(); ++k) {
      const LatchMode mode = dynamics_.modes()[k];
      if (!(mode.upper_contact | mode.lower_contact)) continue;
      const Hinge& hinge = model_.latches.hinge(k);
      const Latches::Law& law = model_.latches.law(k);
      const double* y = stepper_->state();
      const StateIndex& i = model_.index;
      const double theta =
          hinge.sign * (y[i.theta(hinge.outer)] - y[i.theta(hinge.inner)] - hinge.zero);
      const double rate = hinge.sign * (y[i.omega(hinge.outer)] - y[i.omega(hinge.inner)]);
      for (const bool upper : {true, false}) {
        if (!(upper ? mode.upper_contact : mode.lower_contact)) continue;
        const double depth = law.lever * (upper ? theta - law.theta_a : -theta - law.theta_b);
        const double leaving = law.lever * (upper ? -rate : rate);
        if (leaving <= 0.0 || depth <= 0.0) continue;
        const double above = depth - law.epsilon, part = zone_part_ * law.epsilon;
        longest = std::min(longest, std::max(above, part) / leaving);
      }
    }
    return longest;
  }

  double SampleTime() const { return static_cast<double>(report_.samples) / options_.rate; }

  void SampleStep(double h, double t_new) {
    while (SampleTime() <= std::min(t_new, end_ * (1.0 + 1e-12))) {
      const double t = SampleTime();
      stepper_->Dense(std::clamp((t - t_) / h, 0.0, 1.0), sample_.data());
      Hand(t);
    }
  }

  void SampleNow() {
    std::copy_n(stepper_->state(), sample_.size(), sample_.begin());
    Hand(0.0);
  }

  void Hand(double t) {
    if (observer_ != nullptr) observer_->OnSample(t, sample_.data(), dynamics_.modes());
    ++report_.samples;
  }

  void WatchPeaks() {
    for (int k = 0; k < model_.latches.count(); ++k) {
      const LatchMode& mode = dynamics_.modes()[k];
      if (!(mode.upper_contact | mode.lower_contact)) continue;
      const double moment = std::fabs(LatchMoment(model_, k, stepper_->state(), mode));
      if (moment > report_.peak_moment[k]) {
        report_.peak_moment[k] = moment;
        report_.peak_time[k] = t_;
      }
    }
  }

  void Poll() {
    if (observer_ != nullptr) observer_->OnProgress(t_ / end_);
    ThrowIfInterrupted();
    if (report_.steps >= options_.max_steps) {
      Fail(SimulateStatus::kTooManySteps, fmt::format("{} steps taken", report_.steps));
    }
    std::string where;
    if (dynamics_.SmallestPivot(&where) < kSingularPivot) {
      Fail(SimulateStatus::kSingular,
           fmt::format("the constraints became dependent at '{}'", where));
    }
  }

  const Model& model_;
  const SimulateOptions& options_;
  Observer* observer_;
  Dynamics dynamics_;
  ErrorScale scale_;
  std::unique_ptr<Stepper> stepper_;
  EventFinder finder_;
  SimulateReport report_;
  Array sample_;
  double end_ = 0.0;
  double exponent_ = 0.0, memory_ = 0.0;  // of the step control
  double zone_part_ = 0.0;
  double t_ = 0.0;
};

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

[[noreturn]] void BadOption(const char* field, const std::string& what, const char* remedy) {
  throw Error(what, fmt::format("option {}", field), remedy);
}

}  // namespace

void SimulateOptions::Check() const {
  const auto positive = [](double v) { return v > 0.0 && std::isfinite(v); };
  if (!(duration >= 0.0) || duration > 1e7) {
    BadOption("duration", fmt::format("{} s is not a duration", duration), "use 0 to 1e7 s");
  }
  if (!positive(rate) || rate > 1e7) {
    BadOption("rate", fmt::format("{} is not a sampling rate", rate), "use up to 1e7 per second");
  }
  if (!(rtol >= 1e-13 && rtol <= 1e-2)) {
    BadOption("rtol", fmt::format("a tolerance of {} cannot be kept", rtol), "use 1e-13 to 1e-2");
  }
  if (!(length >= 0.0) || !std::isfinite(length)) {
    BadOption("length", fmt::format("{} is not a length", length), "use a positive number");
  }
  if (!positive(time)) BadOption("time", fmt::format("{} is not a time", time), "use 1");
  if (!positive(max_step)) {
    BadOption("max_step", fmt::format("{} is not a step", max_step), "use a positive number");
  }
  if (max_steps <= 0) BadOption("max_steps", "no steps allowed", "use a positive number");
  if (!positive(drift_fraction)) {
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
    default:
      return "too many steps";
  }
}

long SimulateReport::Count(EventKind kind) const {
  return std::count_if(events.begin(), events.end(),
                       [&](const Event& e) { return e.kind == kind; });
}

SimulateReport Simulate(const Model& model, const SimulateOptions& options, Observer* observer) {
  options.Check();
  return Run(model, options, observer).Go();
}

MarkTracks SimulateMarks(const Model& model, SimulateOptions options) {
  options.Check();
  options.track_energy = false;
  MarkTracks tracks;
  const double duration = options.duration > 0.0 ? options.duration : model.duration;
  MarkCollector collector(model, &tracks, static_cast<std::size_t>(duration * options.rate) + 2);
  tracks.report = Simulate(model, options, &collector);
  return tracks;
}

}  // namespace unfurl::sim
