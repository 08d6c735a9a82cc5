#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "data/scene.h"
#include "sim/methods/axial_peak.h"
#include "sim/methods/event.h"

namespace unfurl::sim {

struct Model;
struct Motion;
struct LatchMode;

// How the constraints are kept and the steps are taken; docs/physics-simulator.md, "Methods".
enum class Method { kAuto, kProjected, kPartitioned, kImplicit };
const char* MethodName(Method method);  // "auto", "projected", ...
// Throws Error naming the nearest one.
Method MethodOf(const std::string& name);

/// How a model is run.
struct SimulateOptions {
  Method method = Method::kAuto;
  double duration = 0.0;  // [s]; 0: the scene's
  double rate = 1000.0;   // samples per second, by dense output; steps do not depend on it [1/s]
  // Error allowed per step, relative to the scales below; in [1e-13, 1e-2].
  double rtol = 1e-6;
  // Of the explicit pair: 4, 5 or 8; 0: 4 where rtol is loose, 8 where it is tight
  // (docs/accuracy.md).
  int order = 0;
  double length = 0.0;  // scale of positions; 0: Model::length_scale [m]
  double time = 0.0;    // velocities: length / time, plus what they are; 0: Model::time_scale [s]
  // Longest step; 0: a hundredth of Model::time_scale, so that a function of time that acts for a
  // five-hundredth of the scene's duration is not passed over [s].
  double max_step = 0.0;
  long max_steps = 500'000'000;
  // Constraints are brought back when they have drifted by more than this part of rtol * length
  // (positions) or rtol * length / time (velocities) [-].
  double drift_fraction = 0.1;
  bool track_energy = true;  // integrate what contacts and beams dissipate
  bool track_forces = true;  // watch the pins' forces for their peaks (costs one percent)
  bool profile = false;      // measure the share of each part

  // Throws Error naming the field.
  void Check() const;
};

/// Samples per second of a run of `duration` [s] where nobody asks for a rate: 1000, or where that
/// gives fewer than a thousand samples the next of 1, 2 and 5 times a power of ten that gives as
/// many; 1e7 at most [1/s].
double UsualRate(double duration);

/// How long a run is: as the options say, or the model where they say nothing [s].
double DurationOf(const SimulateOptions& options, const Model& model);

// A step that was taken, as far as it was: the motion within it, by the method's dense output.
class StepMotion {
 public:
  StepMotion(double first, double last, bool fresh, bool final)
      : from(first), to(last), jumped(fresh), ends(final) {}
  virtual ~StepMotion() = default;
  // At a time within the step; written over by the next call.
  virtual double* At(double t) = 0;
  // As they were within the step.
  virtual const std::vector<LatchMode>& modes() const = 0;

  const double from, to;  // [s]
  // An event or an edge of a function of time is where it begins: rates may have jumped there.
  const bool jumped;
  const bool ends;  // at such a place, or at the run's end
};

// What a simulation hands out while it runs. States are in the layout of StateIndex and may be
// written to (stations are filled in); they are gone after the call.
class Observer {
 public:
  virtual ~Observer() = default;
  // At every sampling time.
  virtual void OnSample(double /*t*/, double* /*state*/, const std::vector<LatchMode>& /*modes*/) {}
  // After every step, however short.
  virtual void OnStep(StepMotion& /*step*/) {}
  // While a latch is open, some times within each step: what is there of angles and rates of the
  // bodies that open latches join, all else of the motion zero.
  virtual void OnWay(const Motion& /*motion*/, const std::vector<LatchMode>& /*modes*/) {}
  // In order of time.
  virtual void OnEvent(const Event& /*event*/) {}
  // Now and then; may throw Interrupted.
  virtual void OnProgress(double /*fraction*/) {}
  // Once, of a run that will take more than ten seconds: what limits it and what would shorten it.
  virtual void OnSlow(const std::string& /*text*/) {}
};

enum class SimulateStatus {
  kGood,
  kStepTooSmall,
  kNotFinite,
  kSingular,
  kTooManySteps,
  kEnergy,      // the balance of energy is off: RunJudge
  kDrift,       // constraints drifted far beyond the tolerance
  kMeshCoarse,  // a beam's axial force asks for more segments
  kCrushed      // a smooth beam that stretches is pressed to nothing
};
const char* StatusName(SimulateStatus status);

// What kept a step from being longer: the error allowed; the edge of stability (judged by the
// difference of two stages at the step's end, on every eighth step); growth from a smaller one, at
// most fivefold; options.max_step; the way out of a contact; an event in it; an edge or knot of a
// function of time, or how fast one changes; the end of the run. Samples never do.
enum class StepLimit {
  kError,
  kStability,
  kGrowth,
  kMaxStep,
  kContactExit,
  kEvent,
  kEdge,
  kFunction,
  kEnd
};
inline constexpr int kStepLimits = 9;  // how many there are
const char* LimitName(StepLimit limit);

/// How a run went, and what it cost.
struct SimulateReport {
  SimulateStatus status = SimulateStatus::kGood;
  std::string message;     // what happened, where and when, if not good
  double t_end = 0.0;      // reached [s]
  std::string method;      // what was used, in words
  std::string stopped_by;  // the watch that ended the run, if one did
  // The first and the last of them where there are very many; EventLog.
  std::vector<Event> events;
  long events_left_out = 0;
  std::array<long, kEventKinds> event_counts{};
  std::vector<LatchImpacts> latch_counts;   // by latch
  std::array<long, kStepLimits> limited{};  // steps by what limited them
  long repartitions = 0;                    // dependent coordinates chosen anew; method partitioned
  long near_dependence = 0;  // times that constraints came near to depending on one another
  long steps = 0, rejected = 0, evaluations = 0, projections = 0, samples = 0;
  // Right sides, and in units of one what implicit steps cost beside them: the same run has the
  // same work on any machine.
  double work = 0.0;
  double largest_position_drift = 0.0;  // before it was removed [m]
  double largest_velocity_drift = 0.0;  // [m/s]
  std::vector<double> peak_moment;      // of contact, largest magnitude by latch [N m]
  std::vector<double> peak_time;        // [s]
  // Force between a joint's sides, the largest at the ends of steps, by joint [N], and when [s].
  std::vector<double> peak_pin_force, peak_pin_time;
  // By joint, of bytes: it is not known, since near that time constraints come to depend on one
  // another and it grows; the force is then the largest read at steps.
  std::vector<std::uint8_t> pin_force_unknown;
  // Of the balance of energy, the largest seen and when [s]; what it is judged against [J].
  double energy_residual = 0.0, energy_residual_time = 0.0, energy_moved = 0.0;
  std::vector<AxialPeak> axial;       // by beam
  std::vector<std::string> warnings;  // about the run, one line each
  std::vector<long> worst_bodies;     // where the error weighed most, looked at now and then
  double seconds = 0.0;               // wall clock [s]
  std::vector<double> part_seconds;   // with options.profile, by part of the work [s]

  // The end was reached, and the judge found nothing against it.
  bool Usable() const { return status == SimulateStatus::kGood; }
  bool PinForceUnknown(std::size_t joint) const {
    return joint < pin_force_unknown.size() && pin_force_unknown[joint] != 0;
  }
  // Of a part of the work; 0 without options.profile, and of a run that was interrupted.
  double PartSeconds(int part) const {
    const auto index = static_cast<std::size_t>(part);
    return index < part_seconds.size() ? part_seconds[index] : 0.0;
  }
  long Count(EventKind kind) const { return event_counts[static_cast<int>(kind)]; }
};

// Runs the model from its initial state. Numerical failure is a status, with what was reached kept;
// bad options throw Error. Uses nothing but its arguments: threads may run models side by side.
SimulateReport Simulate(const Model& model, const SimulateOptions& options, Observer* observer);

// The marks alone, without any file: positions and velocities on the sampling grid, so that cubic
// Hermite interpolation gives the tracks at any time.
struct MarkTracks {
  std::vector<double> t;                          // n [s]
  std::vector<std::vector<double>> x, y, vx, vy;  // by mark, n each [m], [m/s]
  SimulateReport report;
};
MarkTracks SimulateMarks(const Model& model, SimulateOptions options);
MarkTracks SimulateMarks(const data::Scene& scene, const SimulateOptions& options);

// A scene made ready to be simulated, by any number of threads: checked, constraints and effects
// set up. Throws Error naming the place in the scene that does not fit.
std::shared_ptr<const Model> CompileModel(const data::Scene& scene);

}  // namespace unfurl::sim
