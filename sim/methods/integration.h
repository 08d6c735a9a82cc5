#pragma once

#include <array>
#include <chrono>
#include <string>
#include <vector>

#include "sim/methods/axial_watch.h"
#include "sim/methods/contact_watch.h"
#include "sim/methods/edges.h"
#include "sim/methods/event_log.h"
#include "sim/methods/events.h"
#include "sim/methods/function_watch.h"
#include "sim/methods/impact_watch.h"
#include "sim/methods/load_peaks.h"
#include "sim/methods/method_switch.h"
#include "sim/methods/pair_choice.h"
#include "sim/methods/path_watch.h"
#include "sim/methods/run_judge.h"
#include "sim/methods/simulate.h"
#include "sim/methods/stepper.h"
#include "sim/methods/stepper_set.h"
#include "sim/methods/table_watch.h"

namespace unfurl::sim {

// One run of a model: step control, drift, events, samples. Used once.
class Integration {
 public:
  Integration(const Model& model, const SimulateOptions& options, Observer* observer);
  SimulateReport Go();

 private:
  void StartMotion();
  void NoteAccepted(double h);
  // Shortens the step about to be tried to what functions of time allow; true: it was.
  bool FollowFunctions(double* h);
  // Shortens a step that was tried and found good to what it saw of the joints' laws; true: it was.
  bool FollowLaws(double* h);
  // Shortens a good implicit step with an event in it to end just past that; true: it was.
  bool EndAtEvent(double* h);
  // Below this, times within a step are equal but for rounding [s].
  double LeastStep() const;
  void CountStep();
  void FillReport();
  void Shrink(double error, double* h);
  void Fail(SimulateStatus status, const std::string& what);
  bool FailIfDependent();
  // The tried step is good: sample it, and accept it, up to the first event in it.
  // `whole`: it ends at an edge or at the run's end.
  void Advance(double h, bool whole);
  // At an edge: the functions go on with their next piece, and velocities that drives prescribe
  // jump with them.
  void PassEdge();
  void FollowRates();
  void HandleEvents();
  void SwitchNearDependence();
  void StepAcross(double* h);
  // After a step that gained so much time: changes between the explicit and the implicit method.
  void SwitchMethod(double gained, double* h);
  double ExplicitTolerance() const;
  bool SparesExplicit(StepperSet::Role role, double* h);
  double StepAtEdge() const;
  void KeepWithinEdge(double* h);
  // Another one takes the steps from here on.
  void TakeOver(StepperSet::Role role, double* h);
  double WeightOfImpact();
  void NextStep(double error, double* h);
  // Shortens the next step to what it would not see of springs and tables.
  void SeeEffects(double* h);
  bool RemoveDrift(double t, double* y);
  void WatchDrift(double position, double velocity, const double* y);
  void FailIfCrushed();
  double ContactStep() const;
  void SampleStep(double h, double t_new);
  // On the step just tried, as far as it is taken, what open latches go through.
  void ShowWay(double h, double sigma);
  void ShowStep(double h, double t_new, bool event, bool whole);
  void Emit(double t);
  // Of the step just tried, of length h, as far as it is taken; `event`: it ends at one.
  void WatchLoads(double h, double sigma, bool event);
  void Poll();
  void SayIfSlow();
  // Judges the run that has come to its end.
  void Judge();

  const Model& model_;
  const SimulateOptions& options_;
  Observer* observer_;
  Dynamics dynamics_;
  ErrorScale scale_;
  Method method_;  // begun with
  StepperSet steppers_;
  StepperSet::Role role_;  // far from where constraints depend on one another
  Stepper* stepper_;       // the one in use
  PairChoice pair_;
  MethodSwitch switch_;
  bool switches_ = false;                               // whether the method may change
  double counted_work_ = 0.0;                           // SimulateReport::work, up to the last step
  std::array<double, StepperSet::kRoles> last_step_{};  // of those not in use; 0: none yet [s]
  EventFinder finder_;
  EventLog log_;
  RunJudge judge_;
  AxialWatch axial_;
  std::vector<Event> found_;  // of one instant
  SimulateReport report_;
  LoadPeaks loads_;
  int poll_steps_ = 1;
  Array sample_, scratch_;  // a state, rates that nobody wants [SI]
  int sampled_ = 0;         // right sides made for samples of this step
  long looked_ = 0;         // in all
  Array way_;               // a state in which nothing but what open latches join is filled in [SI]
  std::vector<double> start_;  // of a stepper that takes over [SI]
  double end_ = 0.0;           // [s]
  Edges edges_;
  FunctionWatch functions_;
  TableWatch tables_;
  PathWatch paths_;
  ContactWatch contacts_;
  ImpactWatch impacts_;
  double last_error_ = 0.0;       // of the last step, over what is allowed [-]
  double zone_part_ = 0.0;        // of a transition zone, per step [-]
  double drift_ = 0.0;            // the largest, in tolerances [-]
  double fastest_ = 0.0;          // velocity where drift was large [m/s]
  bool stretches_ = false;        // a smooth beam does
  bool spares_explicit_ = false;  // it was seen that they lose the balance along an axis
  double held_ = 0.0;             // StrainEnergyAtTolerance [J]
  double edge_rate_ = 0.0;        // of the fastest motion, where steps are kept within it [1/s]
  int kept_within_ = 0;           // steps
  bool loops_ = false;            // constraints may come to depend on one another
  bool is_near_ = false;          // they nearly do
  double largest_pivot_ = 0.0;    // that the smallest has been [-]
  double longest_ = 0.0;          // of the last good steps [s]
  bool across_ = false;           // the step about to be tried is to cross
  int crossings_ = 0;
  int cuts_ = 0;    // of the step about to be tried, to end it where an event was found
  double t_ = 0.0;  // [s]
  std::chrono::steady_clock::time_point begin_;
  // When the pace was looked at last, and which time for the whole run it then foretold [s].
  double pace_from_ = 0.0, pace_t_ = 0.0, foretold_ = 0.0;
  bool said_slow_ = false;
  StepLimit limit_ = StepLimit::kGrowth;  // of the step about to be tried
  bool stable_ = true;                    // as last judged
  bool doubted_ = false;                  // an implicit method may do better; likewise
  double use_ = 0.0;                      // Stepper::StabilityUse; likewise
  bool stopped_ = false;                  // by a watch
  bool jumped_ = true;                    // at t_: StepMotion::jumped
};

}  // namespace unfurl::sim
