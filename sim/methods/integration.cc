#include "sim/methods/integration.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "base/progress.h"
#include "sim/dynamics/flush_denormals.h"
#include "sim/dynamics/observables.h"
#include "sim/methods/choose_method.h"
#include "sim/methods/make_stepper.h"
#include "sim/methods/slow_run.h"

namespace unfurl::sim {
namespace {

// Of the options' time scale: the first step, which grows fivefold per step from there.
constexpr double kFirstStep = 1e-6;
// Over the diagonal entry before elimination: below, constraints depend on one another but for
// rounding.
constexpr double kSingularPivot = 1e-12;
constexpr double kAcrossError = 1e5;  // over the error allowed: taken all the same
constexpr double kForget = 0.97;      // by which the longest step on record fades at each step
// Steps between checks of Ctrl-C, pivots and progress: at most so many, and fewer where steps are
// long, so that a check comes every tenth of a second or so.
constexpr int kPollSteps = 512, kPollBodies = 100'000;
// Steps between checks of the energy: one costs about as much as an evaluation. Of a short run,
// all.
constexpr int kJudgeSteps = 32, kJudgeAll = 64;
constexpr double kMostDrift = 100.0;   // tolerances that constraints may be off by
constexpr int kStabilitySteps = 8;     // between checks of stability
constexpr double kStabilityUse = 0.7;  // from here on stability is what limits the step
// And from here on an implicit method is worth a trial: along the imaginary axis, where undamped
// vibrations are, 5(4) is stable up to 0.3 of the edge along the real one.
constexpr double kDoubt = 0.25;

double SecondsSince(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// What is worth a word, and after how long the rest of the run can be judged by what is done [s].
constexpr double kSlow = 10.0, kJudgeSlow = 1.0;

}  // namespace

Integration::Integration(const Model& model, const SimulateOptions& options, Observer* observer)
    : model_(model),
      options_(options),
      observer_(observer),
      dynamics_(model),
      scale_(ScaleOf(model, options)),
      method_(ChooseMethod(options, model, scale_)),
      steppers_(options, dynamics_, scale_),
      role_(StepperSet::RoleOf(method_)),
      stepper_(steppers_.Get(role_)),
      pair_(method_ == Method::kImplicit),
      switch_(method_ == Method::kImplicit),
      finder_(model),
      log_(model.latches.count()),
      judge_(model, scale_, options.track_energy),
      axial_(model),
      loads_(model, &dynamics_, options.track_forces),
      poll_steps_(std::clamp(kPollBodies / model.rigid_bodies.count, 1, kPollSteps)),
      sample_(model.index.size(), 0.0),
      scratch_(model.index.size(), 0.0),
      way_(model.index.size(), 0.0),
      end_(DurationOf(options, model)),
      edges_(model, end_),
      functions_(model, end_, options.rtol, options.max_step),
      tables_(model, options.rtol),
      paths_(model, scale_),
      contacts_(model, scale_),
      impacts_(model, scale_),
      last_error_(1e-4) {
  dynamics_.track_energy = options.track_energy;
  loops_ = model.constraints.HasLoops(true);
  switches_ = options.method == Method::kAuto && options.order == 0;
  stretches_ = model.kirchhoff.stretches();
  held_ = StrainEnergyAtTolerance(model, scale_);
  start_.assign(sample_.size(), 0.0);
  report_.worst_bodies.assign(model.rigid_bodies.count, 0);
  if (options.profile) {
    report_.part_seconds.assign(Dynamics::kParts, 0.0);
    dynamics_.profile = report_.part_seconds.data();
  }
}

SimulateReport Integration::Go() {
  const FlushDenormals flush;
  begin_ = std::chrono::steady_clock::now();
  StartMotion();
  double h = std::min(kFirstStep * options_.time, options_.max_step);
  while (t_ < end_ && report_.status == SimulateStatus::kGood && !stopped_) {
    // No step crosses an edge of a time function.
    const double stop = edges_.next(), wished = h;
    bool whole = t_ + h >= stop * (1.0 - 1e-15);
    if (whole) {
      h = stop - t_;
      limit_ = edges_.none_left() ? StepLimit::kEnd : StepLimit::kEdge;
    }
    if (!functions_.empty() && FollowFunctions(&h)) whole = false;
    const double error = stepper_->Try(h) * WeightOfImpact();
    report_.work += stepper_->StepOverhead();
    if (!(error <= 1.0) && !(across_ && error <= kAcrossError)) {
      ++report_.rejected;
      Shrink(error, &h);
      StepAcross(&h);
      continue;
    }
    if (!across_ && (FollowLaws(&h) || EndAtEvent(&h))) continue;
    if (error > 1.0 && stepper_->EndsAtTrial()) stepper_->RefreshTrial();
    NoteAccepted(h);
    const double before = t_;
    Advance(h, whole);
    ++report_.limited[static_cast<int>(limit_)];
    NextStep(error, &h);
    if (whole && t_ == stop && stop < end_) {
      PassEdge();
      h = std::max(h, wished);  // what shortened this step does not limit the next one
    }
    if (loops_) SwitchNearDependence();
    if (!is_near_) {
      steppers_.NoteTime(role_, t_ - before);
      if (switches_) SwitchMethod(t_ - before, &h);
    }
    CountStep();
  }
  Judge();
  FillReport();
  report_.seconds = SecondsSince(begin_);
  return std::move(report_);
}

void Integration::StartMotion() {
  dynamics_.SetInterval(edges_.after(), edges_.before());
  stepper_->Start(0.0, model_.initial_state);
  loads_.Begin(t_, stepper_->state());
  if (RemoveDrift(t_, stepper_->state())) stepper_->Refresh();
  std::copy_n(stepper_->state(), sample_.size(), sample_.begin());
  Emit(0.0);
  judge_.Look(0.0, stepper_->state(), dynamics_.modes());
}

void Integration::NoteAccepted(double h) {
  across_ = false;
  cuts_ = 0;
  crossings_ = 0;
  longest_ = std::max(h, kForget * longest_);
  if (report_.steps % kStabilitySteps == 0) {
    // A fast motion that rests now is not seen by the step, and still keeps it short.
    use_ = std::max(stepper_->StabilityUse(), h / StepAtEdge());
    stable_ = use_ < kStabilityUse;
    doubted_ = use_ >= kDoubt;
  }
}

bool Integration::FollowFunctions(double* h) {
  const double wished = *h;
  *h = functions_.Resolved(t_, wished);
  if (*h == wished) return false;
  limit_ = StepLimit::kFunction;
  const std::string complaint = functions_.Complaint();
  if (!complaint.empty()) Fail(SimulateStatus::kTooManySteps, complaint);
  return true;
}

double Integration::LeastStep() const { return 64.0 * std::numeric_limits<double>::epsilon() * t_; }

bool Integration::FollowLaws(double* h) {
  if (paths_.empty() && contacts_.empty()) return false;
  const double part =
      std::min(paths_.Part(t_, *h, stepper_->state(), stepper_->trial()),
               contacts_.Part(dynamics_.MotionAt(t_, stepper_->state()),
                              dynamics_.MotionAt(t_ + *h, stepper_->trial()), *h, dynamics_.modes(),
                              dynamics_.constraint_work().smooth_work));
  if (part >= 1.0 || part * *h <= LeastStep()) return false;
  *h *= part;
  stepper_->Drop();
  ++report_.rejected;
  limit_ = StepLimit::kError;
  return true;
}

void Integration::CountStep() {
  if (++report_.steps % poll_steps_ == 0) Poll();
  if (report_.steps < kJudgeAll || report_.steps % kJudgeSteps == 0) {
    judge_.Look(t_, stepper_->state(), dynamics_.modes());
  }
}

void Integration::FillReport() {
  report_.axial = axial_.peaks();
  report_.warnings = axial_.Warnings();
  for (const std::string& w : functions_.Warnings()) report_.warnings.push_back(w);
  for (const std::string& w : tables_.Warnings()) report_.warnings.push_back(w);
  const std::string energy = judge_.Warning();
  if (!energy.empty()) report_.warnings.push_back(energy);
  report_.t_end = t_;
  report_.method = steppers_.Description(StepperSet::RoleOf(method_));
  report_.evaluations = steppers_.evaluations() + loads_.evaluations() + looked_;
  report_.work += static_cast<double>(report_.evaluations);
  report_.repartitions = steppers_.repartitions();
  loads_.Fill(&report_);
  report_.events = log_.Kept(&report_.events_left_out);
  report_.event_counts = log_.counts();
  report_.latch_counts = log_.latches();
}

void Integration::PassEdge() {
  jumped_ = true;
  edges_.Pass();
  dynamics_.SetInterval(edges_.after(), edges_.before());
  if (model_.constraints.driven()) FollowRates();
  stepper_->Refresh();
  loads_.Begin(t_, stepper_->state());
}

void Integration::FollowRates() {
  // Where a drive's rate jumps, the impulse of least work on the masses: v += M^-1 J^T p with J v
  // as prescribed. The drives do its work, since the other constraints' rates stay zero.
  double* y = stepper_->state();
  dynamics_.RightSide(t_, y, sample_.data());
  const double enough = options_.drift_fraction * scale_.rtol * scale_.speed;
  if (dynamics_.VelocityDrift(t_, y) <= enough) return;
  const double before = judge_.Kinetic(t_, y);
  dynamics_.Project(t_, y);
  if (options_.track_energy) {
    y[model_.index.extra(kExtraWork)] += judge_.Kinetic(t_, y) - before;
  }
}

void Integration::Judge() {
  judge_.Look(t_, stepper_->state(), dynamics_.modes());
  report_.energy_residual = judge_.residual();
  report_.energy_residual_time = judge_.residual_time();
  report_.energy_moved = judge_.moved();
  if (report_.status != SimulateStatus::kGood) return;
  const std::string energy = judge_.Complaint();
  if (!energy.empty()) {
    report_.status = SimulateStatus::kEnergy;
    // Explicit steps at the edge of stability lose the energy of vibrations that may be of no
    // consequence; implicit ones show whether that was so.
    const bool implicit = method_ == Method::kImplicit && options_.method == Method::kImplicit;
    report_.message = energy + (implicit ? "; use a smaller rtol"
                                         : "; try method \"implicit\", or a smaller rtol");
    return;
  }
  if (drift_ <= kMostDrift) return;
  report_.status = SimulateStatus::kDrift;
  report_.message = fmt::format(
      "positions by {:.2g} m, velocities by {:.2g} m/s, {:.0f} tolerances; use a smaller rtol, or "
      "another method",
      report_.largest_position_drift, report_.largest_velocity_drift, drift_);
}

void Integration::Fail(SimulateStatus status, const std::string& what) {
  report_.status = status;
  report_.message = fmt::format("{}, at t = {:.9g} s", what, t_);
}

bool Integration::FailIfDependent() {
  std::string where;
  if (!(dynamics_.SmallestPivot(&where) < kSingularPivot)) return false;
  Fail(SimulateStatus::kSingular, fmt::format("the constraints became dependent at '{}'", where));
  return true;
}

// Beyond it the line would go back along itself.
void Integration::FailIfCrushed() {
  const KirchhoffBeams::Work& work = dynamics_.constraint_work().smooth_work;
  for (int b = 0; b < model_.kirchhoff.count(); ++b) {
    if (model_.kirchhoff.beam(b).rod.LeastStretch(work.rods[b]) > 0.0) continue;
    Fail(SimulateStatus::kCrushed,
         fmt::format("beam '{}' is pressed to no length at all, where EA means nothing; use a "
                     "larger EA, or a smaller load",
                     model_.kirchhoff.beam(b).name));
    return;
  }
}

void Integration::Advance(double h, bool whole) {
  loads_.ReadEnd(stepper_->trial());
  if (!axial_.empty()) {
    axial_.Look(t_ + h, dynamics_.Multipliers(), stepper_->trial());
    if (axial_.MustStop()) Fail(SimulateStatus::kMeshCoarse, axial_.Complaint());
  }
  if (stretches_) FailIfCrushed();
  const bool at_trial = stepper_->EndsAtTrial();
  if (at_trial && RemoveDrift(t_ + h, stepper_->trial())) stepper_->RefreshTrial();
  double sigma = 1.0;
  const bool event = !finder_.empty() && finder_.FindFirst(*stepper_, dynamics_.modes(), &sigma);
  const double t_new = event ? t_ + sigma * h : whole ? edges_.next() : t_ + h;
  SampleStep(h, t_new);
  ShowStep(h, t_new, event, whole);
  ShowWay(h, event ? sigma : 1.0);
  WatchLoads(h, event ? sigma : 1.0, event);
  t_ = t_new;
  if (!event) {
    stepper_->Accept(t_);
    if (!at_trial && RemoveDrift(t_, stepper_->state())) stepper_->Refresh();
    finder_.Follow(stepper_->state());
    return;
  }
  limit_ = StepLimit::kEvent;
  stepper_->AcceptUntil(sigma, t_);
  HandleEvents();
  stepper_->Refresh();
  if (RemoveDrift(t_, stepper_->state())) stepper_->Refresh();
  loads_.Begin(t_, stepper_->state(), role_ != StepperSet::kImplicit);
}

void Integration::HandleEvents() {
  found_.clear();
  const int ending = finder_.Apply(stepper_->state(), t_, &dynamics_.modes(), &found_);
  for (const Event& event : found_) {
    log_.Add(event);
    if (observer_ != nullptr) observer_->OnEvent(event);
  }
  if (ending >= 0) {
    stopped_ = true;
    report_.stopped_by = model_.watches.at(ending).name;
  }
}

// In tolerances; that of a velocity is of the fastest seen, too, as steps' errors are of their own
// size and stay when what moved fast has come to rest.
void Integration::WatchDrift(double position, double velocity, const double* y) {
  report_.largest_position_drift = std::max(report_.largest_position_drift, position);
  report_.largest_velocity_drift = std::max(report_.largest_velocity_drift, velocity);
  if (velocity > kMostDrift * scale_.rtol * scale_.speed) {
    const int n = model_.rigid_bodies.count;
    for (int k = 3 * n; k < 6 * n; ++k) {
      fastest_ = std::max(fastest_, std::fabs(y[k]) * (k < 5 * n ? 1.0 : scale_.length));
    }
  }
  const double of_length = position / scale_.length,
               of_speed = velocity / (scale_.speed + fastest_);
  drift_ = std::max({drift_, of_length / scale_.rtol, of_speed / scale_.rtol});
}

// Brings the constraints back where they have drifted too far, with the factor of the last right
// side, which was at `y`. True when `y` was changed.
bool Integration::RemoveDrift(double t, double* y) {
  if (model_.constraints.count() == 0) return false;
  const double length = scale_.rtol * scale_.length, speed = scale_.rtol * scale_.speed;
  const double position = dynamics_.PositionDrift(t, y);
  const double velocity = dynamics_.VelocityDrift(t, y);
  WatchDrift(position, velocity, y);
  const double part = options_.drift_fraction / stepper_->Strictness();
  if (position <= part * length && velocity <= part * speed) return false;
  stepper_->Project(t, y);
  ++report_.projections;
  return true;
}

void Integration::Poll() {
  ++report_.worst_bodies[stepper_->WorstBody()];
  if (observer_ != nullptr) observer_->OnProgress(t_ / end_);
  SayIfSlow();
  ThrowIfInterrupted();
  if (report_.steps >= options_.max_steps) {
    Fail(SimulateStatus::kTooManySteps, fmt::format("{} steps taken", report_.steps));
  }
}

void Integration::SayIfSlow() {
  if (said_slow_ || observer_ == nullptr || !(t_ > 0.0)) return;
  const double so_far = SecondsSince(begin_);
  if (so_far < std::max(kJudgeSlow, 2.0 * pace_from_) || !(t_ > pace_t_)) return;
  // By the pace since the last look, at half of the time: a start in tiny steps says nothing of
  // what follows. Said where two looks agree within a factor of two.
  const double in_all = so_far + (end_ - t_) * (so_far - pace_from_) / (t_ - pace_t_);
  const bool agrees = foretold_ > 0.0 && in_all > 0.5 * foretold_;
  pace_from_ = so_far;
  pace_t_ = t_;
  foretold_ = in_all;
  if (in_all < kSlow || !agrees) return;
  said_slow_ = true;
  observer_->OnSlow(AboutSlowRun(model_, options_, report_, in_all));
}

}  // namespace unfurl::sim
