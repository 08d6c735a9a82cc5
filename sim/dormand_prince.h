#pragma once

#include <array>
#include <vector>

#include "sim/aligned.h"
#include "sim/dynamics.h"

namespace unfurl::sim {

// What error of a step is allowed, entry by entry: rtol times a scale in the entry's own unit.
struct ErrorScale {
  double rtol = 1e-5;
  double length = 1.0;  // of positions [m]
  double angle = 1.0;   // [rad]
  double speed = 1.0;   // of velocities, to which |v| is added [m/s]
  double energy = 0.0;  // of what is dissipated; 0: not controlled [J]
  double spin = 1.0;    // of angular velocities, to which |omega| is added [rad/s]
};

// The explicit Runge-Kutta pair 5(4) of Dormand and Prince (1980) with its dense output of fourth
// order (Hairer, Norsett and Wanner, Solving ODEs I, II.6). One step from state() is tried, then
// accepted, cut short at a dense point, or given up.
class DormandPrince {
 public:
  DormandPrince(Dynamics& dynamics, const ErrorScale& scale);

  // Sets the state and evaluates the right side there.
  void Start(const std::vector<double>& y);
  double* state() { return y_.data(); }
  const double* state() const { return y_.data(); }
  double* trial() { return trial_.data(); }
  long evaluations() const { return evaluations_; }

  // Evaluates the right side at state() anew, after it or the modes have changed.
  void Refresh();

  // Tries a step of size h [s]; returns the error in units of what is allowed (1: just accepted;
  // not finite: the step ran away). The last stage is the right side at the trial state.
  double Try(double h);
  // The trial becomes the state; its right side is already known.
  void Accept();
  // The state becomes the dense point at sigma in (0, 1]; call Refresh after the modes are set.
  void AcceptUntil(double sigma);

  // Entries of the dense state of the last tried step.
  double Dense(int entry, double sigma) const;
  void Dense(double sigma, double* out) const;
  // Coefficients of the entry as a polynomial in sigma, lowest power first.
  std::array<double, 5> Polynomial(int entry) const;

  // The slot whose error weighs most in the last tried step.
  int WorstSlot() const;

 private:
  double ErrorNorm(double h);
  double WeightedError(int entry, double h) const;

  Dynamics& dynamics_;
  ErrorScale scale_;
  int n_ = 0;     // slots
  int size_ = 0;  // entries of a state
  long evaluations_ = 0;
  double h_ = 0.0;
  double norm_factor_ = 0.0;
  Array y_, trial_, stage_;
  std::array<Array, 7> k_;
  Array position_weight_, angle_weight_, mask_;  // by slot; zero where nothing moves by itself
};

}  // namespace unfurl::sim
