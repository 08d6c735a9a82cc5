#pragma once

#include <string>
#include <vector>

#include "sim/effects/joint_forces.h"
#include "sim/methods/simulate.h"
#include "sim/methods/stepper.h"

namespace unfurl::sim {

// Of a peak: what lies above it by less is not looked for. Loads that come from a motion with an
// error of 1e-6 are rarely known better.
inline constexpr double kPeakFound = 1e-3;

// The largest loads of a run, of pins and of latches' contacts. Loads are known where right sides
// are, at the ends of steps; a step that resolves a motion well may still have the peak of a load
// in its middle, the more so the higher the method's order. So where a parabola through the last
// three ends says that a load may be larger inside than it was so far, right sides are made there:
// in the middle, and then where the parabola through the three nearest has its top.
class LoadPeaks {
 public:
  struct Peak {
    double value = 0.0, t = 0.0;  // [N] or [N m], [s]
    bool unknown = false;         // it grows near t; `value` is the largest read at steps
  };

  // `pins`: of these too, and inside steps; else contacts alone, at the ends of steps.
  LoadPeaks(const Model& model, Dynamics* dynamics, bool pins);

  // Where a motion begins, and where loads may have jumped. The last right side was at `state`;
  // `counts`: loads there are the motion's, and not an interpolation's.
  void Begin(double t, const double* state, bool counts = true);
  // After a good try of a step, with the right side that it ended with still the last one.
  void ReadEnd(const double* trial);
  // The step of length h from t on is taken as far as sigma (1: all of it). True: right sides were
  // made, and the last one is not at the trial any more.
  bool Step(Stepper* stepper, double t, double h, double sigma);

  // Of a step taken, where constraints nearly depend on one another: finds where in it they come
  // nearest to that, and whether the loads of pins grow as one over the distance from there. Of
  // those that do no peak is known: they have none, or the motion's error makes them grow. True:
  // right sides were made.
  bool LookAcross(Stepper* stepper, double t, double h, double sigma);

  // What the report says of loads, with a warning of those that nobody knows.
  void Fill(SimulateReport* report) const;
  long evaluations() const { return evaluations_; }  // right sides made

 private:
  void Read(const double* state, std::vector<double>* loads) const;
  // The right side at a place of a step.
  void EvaluateAt(Stepper* stepper, double t, double h, double sigma);
  void ReadAt(Stepper* stepper, double t, double h, double sigma, std::vector<double>* loads);
  void LookBeside(Stepper* stepper, double t, double h, double place, double room);
  void Note(const std::vector<double>& loads, double t);
  std::string Warning() const;
  bool MayBeInside(double h) const;
  static bool Resolves(const Stepper& stepper);
  void LookInside(Stepper* stepper, double t, double h, double sigma);
  // Where in a step they come nearest to depending on one another [-].
  double NearestDependence(Stepper* stepper, double t, double h, double sigma);
  // Smallest pivot of the constraints at a place of a step [-].
  double PivotAt(Stepper* stepper, double t, double h, double sigma);
  // Loads at a place of a step, of [0, 1].
  struct Place {
    double at = 0.0;            // [-]
    std::vector<double> loads;  // [N], [N m]
  };
  // Between three places, where the load that gains most by it has its top.
  double Top(const Place& low, const Place& middle, const Place& high, std::size_t* load,
             double* gain) const;

  const Model& model_;
  Dynamics& dynamics_;
  const bool pins_;
  const std::size_t joints_;
  JointForces forces_;
  // By joint, then by latch: at the start of the step before and at both ends of this one.
  std::vector<double> before_, start_, end_;  // [N], [N m]
  Place low_, middle_, high_, new_;           // inside a step
  std::vector<Peak> peaks_;
  Array state_, rates_;    // inside a step [SI]
  double h_before_ = 0.0;  // length of the step before; 0: loads jumped since [s]
  long evaluations_ = 0;
};

}  // namespace unfurl::sim
