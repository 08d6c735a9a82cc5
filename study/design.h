#pragma once

#include <functional>
#include <string>
#include <vector>

#include "correlate/design/contributions.h"
#include "data/design.h"
#include "study/fit_study.h"

namespace unfurl::study {

/// What is asked of a design.
struct DesignOptions {
  data::Design candidates;          ///< what could be measured
  std::vector<std::string> wanted;  ///< parameters whose errors count; empty: all
  std::string trial;                ///< in whose manner the next is planned; empty: the first
  /// The strobe's cycle: a mark's name or "dark" in each line. Empty: as the tracks' stamps show.
  std::vector<std::string> cycle;
  double line_rate = 0.0;           ///< of it [1/s]
  std::vector<std::string> kept;    ///< marks that stay lit in some line
  correlate::CameraSights cameras;  ///< of the rig that saw the marks; without names: not told
  int stretches = 8;                ///< in time, whose shares are told
  std::size_t workers = 0;          ///< model evaluations at a time; 0: one per core
  bool allow_programs = false;      ///< as FitStudyOptions
  std::function<void(double, const std::string&)> progress;  ///< part done [0, 1]; may throw
  /// Throws Error naming the field.
  void Check() const;
};

/// Names of the cases that take in all candidates of a kind.
inline constexpr char kBestOfAll[] = "the best of all", kAllOfThese[] = "all of these";

/// Something that could be measured next, and what it would leave open.
struct DesignCase {
  std::string name;
  std::string message;             ///< why there are no figures
  std::vector<double> alone;       ///< standard error by that trial alone, by parameter [unit]
  std::vector<double> together;    ///< with what the study has [unit]
  std::vector<std::string> cycle;  ///< of the strobe, where it has one of its own
};

/// What a study's trials tell, and what would tell more.
struct StudyDesign {
  StudyFit fit;                      ///< as the study says
  correlate::Contributions tells;    ///< what of the trials at hand tells of each parameter
  std::vector<std::string> wanted;   ///< parameters that counted
  std::vector<double> now;           ///< standard error of the data at hand, by parameter [unit]
  std::vector<std::string> cycle;    ///< of the strobe as it is; empty: none
  double line = 0.0;                 ///< duration of one of its lines [s]
  std::string no_cycle;              ///< why there is none
  std::size_t trial = 0;             ///< in whose manner others are planned
  DesignCase again;                  ///< the same trial once more
  DesignCase schedule;               ///< with the best cycle of the marks that are there
  std::vector<DesignCase> marks;     ///< each candidate taken in, in the best cycle with it
  std::vector<DesignCase> channels;  ///< each candidate instrument beside what is there
  std::vector<DesignCase> trials;    ///< each candidate, with the cycle as it is
  std::vector<std::string> notes;    ///< in sentences: what the figures do not know
};

/// Fits the study, and tells from its sensitivities what each mark, instrument, line of the strobe
/// and stretch of time tells of each parameter, and what standard errors a trial would have with
/// another strobe, other marks, more instruments, other settings. Standard errors are those of the
/// data, at the fitted values: the mesh's own error is not in them. Of a fit that
/// is not usable nothing is told (fit.Usable()). Throws Error for bad input.
StudyDesign DesignStudy(const data::Study& study, const DesignOptions& options);

}  // namespace unfurl::study
