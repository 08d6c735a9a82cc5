#pragma once

#include <functional>
#include <string>
#include <vector>

#include "correlate/fit/held_out.h"
#include "data/study.h"
#include "study/fit_study.h"

namespace unfurl::study {

/// How rival models of one trial are compared.
struct RivalsOptions {
  std::size_t workers = 0;      ///< model evaluations at a time; 0: one per core
  bool allow_programs = false;  ///< as FitStudyOptions
  std::function<void(double, const std::string&)> progress;  ///< part done [0, 1]; may throw
};

/// One of several studies of the same trial.
struct Rival {
  std::string name;         ///< of the study
  std::string path;         ///< its file
  StudyFit fit;             ///< as it says
  std::string message;      ///< why it takes no part; empty: it does
  double deviance = 0.0;    ///< -2 log likelihood above that of the best [-]
  double parameters = 0.0;  ///< that it fits [-]
  /// That it is the right one, were one of them right and none preferred beforehand [0, 1].
  double probability = 0.0;
  bool explains = false;             ///< the trial, by correlate::Explained
  correlate::PredictiveGain behind;  ///< by how much the best predicts held-out stretches better
};

/// Whether the model of a fit explains all its trials, by correlate::Explained: as their errors
/// are, or as noise would be.
bool Explains(const StudyFit& fit);

/// Fits each study and compares them on the same data, by the noise that the one with the least
/// residuals has found: competing laws of contact, friction or damping, each with parameters of its
/// own. Probabilities are Schwarz's: a parameter costs log n. The most probable comes first; those
/// that could not be fitted come last, with probability 0. Throws Error for fewer than two, for
/// studies of unlike trials, a study of a program.
std::vector<Rival> WeighRivals(const std::vector<data::Study>& studies,
                               const RivalsOptions& options);

}  // namespace unfurl::study
