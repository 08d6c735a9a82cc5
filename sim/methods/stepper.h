#pragma once

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "sim/dynamics/dynamics.h"
#include "sim/model/aligned.h"

namespace unfurl::sim {

// What error of a step is allowed, entry by entry: rtol times a scale in the entry's own unit.
struct ErrorScale {
  double rtol = 1e-5;   // [-]
  double length = 1.0;  // of positions [m]
  double angle = 1.0;   // [rad]
  double speed = 1.0;   // of velocities, to which |v| is added [m/s]
  // Of what is integrated beside, to which its own size is added; 0: not controlled [J].
  double energy = 0.0;
  double spin = 1.0;  // of angular velocities, to which |omega| is added [rad/s]
};

// An entry of the state within a step, as a polynomial in the part sigma of the step, lowest power
// first.
struct DensePolynomial {
  static constexpr int kMostCoefficients = 8;  // degree seven: the dense output of order eight
  std::array<double, kMostCoefficients> c{};   // [SI]
  int count = 0;                               // of coefficients

  double operator()(double s) const {
    double value = 0.0;
    for (int k = count - 1; k >= 0; --k) value = value * s + c[k];
    return value;
  }
  double Slope(double s) const {
    double value = 0.0;
    for (int k = count - 1; k >= 1; --k) value = value * s + k * c[k];
    return value;
  }
};

// A one-step method: a step from state() is tried, then accepted, cut short at a dense point, or
// given up. Between calls state() holds a state whose right side is known to the method; who writes
// to it, or changes the modes of the dynamics, calls Refresh.
class Stepper {
 public:
  Stepper(Dynamics& dynamics, const ErrorScale& scale);
  virtual ~Stepper() = default;
  Stepper(const Stepper&) = delete;
  Stepper& operator=(const Stepper&) = delete;

  // Sets time and state.
  void Start(double t, const std::vector<double>& y);
  double time() const { return t_; }
  double* state() { return y_.data(); }
  const double* state() const { return y_.data(); }
  double* trial() { return trial_.data(); }
  const double* trial() const { return trial_.data(); }
  long evaluations() const { return evaluations_; }  // of the right side
  // Error allowed per step, where it is not the run's [-].
  void SetTolerance(double rtol);

  // Exponent by which the error falls with the step, for step control: 5 for a pair 5(4).
  virtual int ErrorOrder() const = 0;
  virtual const char* name() const = 0;
  // The method in words, as reports have it.
  virtual std::string Description() const {
    return std::string(name()) + ", coordinate projection";
  }
  // Takes the constraints' drift out of `y`, where the last right side was.
  virtual void Project(double t, double* y) { dynamics_.Project(t, y); }
  // How much smaller than the tolerance a step keeps its error, and drift is kept with it.
  virtual double Strictness() const { return 1.0; }
  // Evaluates the right side at state() anew.
  virtual void Refresh() = 0;
  // Tries a step of size h [s]; returns the error in units of what is allowed (1: just accepted;
  // not finite: the step ran away).
  virtual double Try(double h) = 0;
  // Where Try ends with the right side at an accepted trial, drift is removed there, before the
  // dense output is made: who writes to trial() then calls RefreshTrial.
  virtual bool EndsAtTrial() const { return false; }
  virtual void RefreshTrial() {}
  // The last step tried, good by its error, is not taken all the same.
  virtual void Drop() {}
  // The trial becomes the state, at time t.
  virtual void Accept(double t) = 0;
  // The state becomes the dense point at sigma in (0, 1], at time t; call Refresh after the modes
  // are set.
  virtual void AcceptUntil(double sigma, double t);
  // An entry of the state within the last tried step. The first call after Try may evaluate the
  // right side some more times.
  virtual DensePolynomial Polynomial(int entry) = 0;
  virtual void Dense(double sigma, double* out);
  // As Dense, but for loads: with what is stiff where the right side wants it. May evaluate the
  // right side once, beside evaluations(), which is then not the trial's any more; true: it did.
  virtual bool Sample(double sigma, double* out) {
    Dense(sigma, out);
    return false;
  }
  // How far the velocities within the last tried step may be off, in units of the error allowed to
  // a step; 0: no further than at its ends.
  virtual double DenseDoubt(double /*sigma*/) { return 0.0; }
  // Whether Polynomial costs no further evaluation.
  virtual bool DenseIsFree() const { return true; }
  // A cheaper stand-in for Polynomial, off by at most about `margin` anywhere in the step.
  virtual DensePolynomial Cubic(int entry, double* margin) const;
  // After Try: h |lambda| of the fastest motion seen, over what the method is stable for (some 1
  // where stability and not accuracy limits the step); 0 where the method cannot tell.
  virtual double StabilityUse() const { return 0.0; }
  // h |lambda| where StabilityUse is 1.
  virtual double StabilityEdge() const { return 1.0; }
  // Of an explicit method: h |lambda| at the edge of stability (along the real axis, where it is
  // farthest) per right side of a step; 0: stability sets no edge.
  virtual double StableReach() const { return 0.0; }
  // |lambda| of the fastest motion there is at the state [1/s], by power iteration on the right
  // side; 0 where the method does not look.
  virtual double ProbeFastestRate() { return 0.0; }
  // What a tried step costs beside its right sides, in right sides.
  virtual double StepOverhead() const { return 0.0; }
  // Times that dependent coordinates were chosen anew; method partitioned.
  virtual long repartitions() const { return 0; }

  // The body whose error weighs most in the last tried step.
  int WorstBody() const;

 protected:
  // Of a method that may keep the constraints at every stage and at the trial: called before each
  // right side; false: the step is given up.
  virtual bool Settle(double /*t*/, double* /*y*/) { return true; }
  static constexpr double kGivenUp = 1e6;  // error of a step that was given up
  // The right side at a stage, settled; false: give the step up.
  bool Stage(double t, double* y, double* rate);
  // Error of an entry in the last tried step, in its own unit.
  virtual double ErrorOf(int entry) const = 0;
  double WeightedError(int entry) const;
  // |lambda| [1/s] as two states at one time and their rates tell it: of a motion x'' = f(x, x'),
  // the square root of the difference in x'' over that in x, both in the norm of the masses.
  double FastestRate(const double* state_a, const double* rate_a, const double* state_b,
                     const double* rate_b) const;

  // Root mean square of error(entry) over what is allowed, and each energy by itself: there are few
  // of them, and many bodies would hide their error. `error` is called for every entry, those that
  // do not move included.
  template <typename Error>
  double Norm(const double* y, const double* out, Error error) const {
    const double* __restrict mask = mask_.data();
    double sum[kBlock] = {};
    for (int block = 0; block < 3; ++block) {
      const double* __restrict weight = block < 2 ? position_weight_.data() : angle_weight_.data();
      for (int i = 0; i < n_; i += kBlock) {
        for (int k = 0; k < kBlock; ++k) {
          const double e = weight[i + k] * error(block * n_ + i + k);
          sum[k] += e * e;
        }
      }
    }
    for (int block = 3; block < 6; ++block) {
      const double floor = block < 5 ? scale_.speed : scale_.spin;
      const double inverse_rtol = 1.0 / scale_.rtol;
      for (int i = 0; i < n_; i += kBlock) {
        for (int k = 0; k < kBlock; ++k) {
          const int j = block * n_ + i + k;
          const double a = std::fabs(y[j]), b = std::fabs(out[j]);
          const double e = mask[i + k] * inverse_rtol * error(j) / (floor + (a > b ? a : b));
          sum[k] += e * e;
        }
      }
    }
    double total = 0.0;
    for (double part : sum) total += part;
    total *= norm_factor_;
    if (scale_.energy > 0.0) {
      for (int k = 0; k < kExtrasUsed; ++k) {
        const int j = 6 * n_ + k;
        const double e = error(j) / (scale_.rtol * (scale_.energy + std::fabs(y[j])));
        total += e * e;
      }
    }
    return std::sqrt(total);
  }

  Dynamics& dynamics_;
  ErrorScale scale_;
  int n_ = 0;     // bodies
  int size_ = 0;  // entries of a state
  long evaluations_ = 0;
  double t_ = 0.0, h_ = 0.0;  // [s]
  Array y_, trial_, stage_;   // [SI]
  Array mass_, inertia_;      // of FastestRate's norm, by body [kg], [kg m^2]

 private:
  double norm_factor_ = 0.0;                     // [-]
  Array position_weight_, angle_weight_, mask_;  // by body; zero where nothing moves by itself [-]
};

}  // namespace unfurl::sim
