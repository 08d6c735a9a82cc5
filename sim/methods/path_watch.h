#pragma once

#include <vector>

#include "sim/methods/stepper.h"
#include "sim/model/model.h"

namespace unfurl::sim {

// A joint's coordinate within a step, as the cubic through its values and rates at both ends.
class JointPath {
 public:
  JointPath(const Coordinate::State& start, const Coordinate::State& end, double h);

  double h() const { return h_; }
  double Value(double s) const { return start_.value + s * (c1_ + s * (c2_ + s * c3_)); }  // [rad]
  double Rate(double s) const { return start_.rate + s * (d1_ + s * d2_); }  // [rad/s]
  // Where in (0, end) the rate turns, or the value; false: nowhere.
  bool RateTurns(double end, double* at) const;
  // The first place in (0, 1] where the rate, which starts beyond it, comes to `rate`; 1: nowhere.
  double FirstAt(double rate) const;

 private:
  Coordinate::State start_;
  double h_;             // [s]
  double c1_, c2_, c3_;  // of the value [rad]
  double d1_, d2_;       // of the rate [rad/s]
};

// Whether a step that was tried, and found good by its estimate, has seen the joints' laws that are
// narrow in their coordinate or its rate: a reversal against dry friction, the points of a table.
// What lies between a method's stages neither moves anything nor shows in the estimate of the
// error, so the law along the step is held against a quartic through five of its values.
class PathWatch {
 public:
  PathWatch(const Model& model, const ErrorScale& scale);

  bool empty() const { return friction_.count() == 0 && tables_.count() == 0; }
  // Of the step of h [s] from `state` to `trial`: the part that is to be tried in its place; 1: it
  // is good. A reversal is met where the creep band begins.
  double Part(double t, double h, const double* state, const double* trial);

 private:
  Motion MotionOf(double t, const double* state, const Coordinate& coordinate);
  JointPath PathOf(double t, double h, const double* state, const double* trial,
                   const Coordinate& coordinate);
  double Mobility(const Coordinate& coordinate, const Motion& motion);
  double TablePart(int k, double t, double h, const double* state, const double* trial);
  double FrictionPart(int k, double t, double h, const double* state, const double* trial);

  const Model& model_;
  const JointEffect<Friction>& friction_;
  const JointEffect<MomentTable>& tables_;
  const ErrorScale scale_;
  const double part_;    // of a table's range, that it may be off
  Array cosine_, sine_;  // of the two bodies at hand
  Array fx_, fy_, m_;    // likewise [N], [N m]
};

}  // namespace unfurl::sim
