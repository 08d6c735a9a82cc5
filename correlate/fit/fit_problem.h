#pragma once

#include <string>
#include <vector>

#include "correlate/fit/parameter.h"
#include "correlate/model.h"
#include "correlate/observations.h"

namespace unfurl::correlate {

// One trial and the model of it. Models and observations must outlive the fit.
struct FitTrial {
  std::string name;
  const Observations* observations = nullptr;  // unsmoothed, with covariances
  const Model* model = nullptr;

  // The same model with a tighter tolerance of its solver: what it moves the marks by is the
  // model's own noise, to which the steps of differences are tied; null: what predictions report.
  const Model* tighter = nullptr;
  // The same model with less discretisation error, asked once, at the estimate; null: none. What
  // it moves the marks by, times `finer_factor`, is taken for the model's own error: 4/3 where the
  // finer mesh has half the spacing and the error falls with its square.
  const Model* finer = nullptr;
  double finer_factor = 4.0 / 3.0;

  // Trials reconstructed with one calibration share its error; a name for it. Empty: its own.
  std::string calibration;
};

// What is fitted to what.
struct FitProblem {
  std::vector<Parameter> parameters;
  std::vector<FitTrial> trials;
};

// Which of a trial's models is asked.
enum class Fidelity : std::int32_t { kMain = 0, kTighter = 1, kFiner = 2 };
const Model* ModelOf(const FitTrial& trial, Fidelity fidelity);

}  // namespace unfurl::correlate
