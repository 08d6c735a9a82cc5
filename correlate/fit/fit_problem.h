#pragma once

#include <string>
#include <vector>

#include "correlate/fit/parameter.h"
#include "correlate/model.h"
#include "correlate/observations.h"

namespace unfurl::correlate {

/// A version of a trial's model with less error of its own than the rung below it.
struct Rung {
  const Model* model = nullptr;
  std::string name;  ///< "16 segments"
  /// Its discretisation error relative to that of the trial's `model`, as theory has it [-]; 0: not
  /// known, and the last change of the ladder stands for what is left.
  double error = 0.0;
};

/// The model with a little of a law that it lacks (friction where it has viscous damping), asked
/// once, at the estimate: where what is left of the data is better explained with some of it, the
/// model lacks it, or something like it.
struct RivalLaw {
  const Model* model = nullptr;
  std::string name;     ///< "dry friction in hinge"
  std::string unit;     ///< of `amount`
  double amount = 0.0;  ///< how much of it the model has [unit]
};

// One trial and the model of it. Models and observations must outlive the fit.
struct FitTrial {
  std::string name;
  const Observations* observations = nullptr;  // unsmoothed, with covariances
  const Model* model = nullptr;

  // The same model with a tighter tolerance of its solver: what it moves the marks by is the
  // model's own noise, to which the steps of differences are tied; null: what predictions report.
  const Model* tighter = nullptr;
  // The same model with less discretisation error, asked once, at the estimate; null: none. What
  // it moves the marks by, times `finer_factor`, is taken for the model's own error: 4/3 where
  // the finer mesh has half the spacing and the error falls with its square.
  const Model* finer = nullptr;
  double finer_factor = 4.0 / 3.0;  // [-]
  // Instead of `finer`: rungs above `model`, each with less error than the one before; the fit then
  // means the last of them (docs/physics-correlation.md, "The ladder"). As many in every trial.
  std::vector<Rung> rungs;
  std::vector<RivalLaw> rivals;
  std::string model_name = "the model";  // of the lowest rung
  double model_relative_error = 1.0;     // of the lowest rung, as Rung::error [-]

  // Trials reconstructed with one calibration share its error; a name for it. Empty: its own.
  std::string calibration;
};

// What is fitted to what.
struct FitProblem {
  std::vector<Parameter> parameters;
  std::vector<FitTrial> trials;
};

// Which of a trial's models is asked; kRung + i: rungs[i], and beyond the last of them rivals.
enum class Fidelity : std::int32_t { kMain = 0, kTighter = 1, kFiner = 2, kRung = 3 };
// Of rung 0 (the trial's `model`), 1 (rungs[0]), ...
Fidelity FidelityOfRung(std::size_t rung);
// Of a trial's rivals[i].
Fidelity FidelityOfRival(const FitTrial& trial, std::size_t i);
const Model* ModelOf(const FitTrial& trial, Fidelity fidelity);

}  // namespace unfurl::correlate
