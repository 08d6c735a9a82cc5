#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/error.h"
#include "correlate/compare/comparison.h"
#include "correlate/fit/fit.h"
#include "data/fit.h"
#include "data/journal.h"
#include "data/provenance.h"
#include "data/run.h"
#include "data/study.h"
#include "study/study_binding.h"

namespace unfurl::study {

/// How a study is fitted. The defaults fit it in memory and write nothing.
struct FitStudyOptions {
  /// Tracks to fit to in place of those that the study names; empty: the study's own. A study of
  /// several trials refuses it.
  std::string tracks;
  /// Model evaluations at a time; 0: one per core. Does not change the result.
  std::size_t workers = 0;
  /// The fit to write (HDF5). Every evaluation is kept in OUTPUT.partial until the fit is written,
  /// so that a fit that was stopped can be resumed. Empty: nothing is written.
  std::string output;
  /// Take the evaluations of OUTPUT.partial over. The result is the same to the last byte.
  bool resume = false;
  /// A study may name a program that computes the marks (model.command). It is run only where this
  /// says that whoever wrote the study is trusted; else Error.
  bool allow_programs = false;
  /// Program, command and options to be stored with the result. The inputs are added.
  data::Provenance provenance;
  /// Whether trial and model are compared at the estimate (first trial), for a page or a plot.
  bool compare = false;
  /// Whether the scene's motion there is kept, too: a run more.
  bool keep_motion = false;
  /// Called at the start when evaluations were taken over: how many, and the file.
  std::function<void(std::size_t, const std::string&)> on_resume;
  /// Called now and then, from any thread.
  std::function<void(const correlate::FitProgress&)> progress;
  /// What carries the evaluations out: called once all is read, with the problems that will be
  /// fitted (several where trials are fitted one by one) and the identity of all that answers
  /// depend on but the question. What it gives must outlive the fit. Empty, or null given: threads
  /// of this program, `workers` of them.
  std::function<correlate::Workers*(const std::vector<const correlate::FitProblem*>&,
                                    const std::string& identity)>
      where;
};

/// A fitted study. Moves; does not copy, since `problem` points into `binding`.
struct StudyFit {
  std::unique_ptr<BoundStudy> binding;  ///< models and observations that the fit ran on
  correlate::FitResult result;          ///< numbers, with status
  data::FitRecord record;               ///< the same as a record for files, verdicts in words
  data::Provenance provenance;          ///< inputs by hash
  correlate::Comparison comparison;     ///< at the estimate; without errors: none was made
  std::optional<data::Run> motion;      ///< likewise, marks and shapes; none of a program's

  // The problem as it was fitted; lives as long as `binding`.
  const correlate::FitProblem& problem() const { return binding->problem; }
  // Whether the estimate may be used: the fit converged and can be judged.
  bool Usable() const { return result.Usable(); }
};

/// A fit that was interrupted, with what it leaves behind.
class FitInterrupted : public Interrupted {
 public:
  FitInterrupted(std::size_t evaluations_, std::string journal_)
      : evaluations(evaluations_), journal(std::move(journal_)) {}
  std::size_t evaluations;  ///< that are kept in `journal`
  std::string journal;      ///< path
};

/// Fits the parameters of a study to its trials: reads the tracks, binds the scene or the program
/// that computes the marks, fits (correlate::Fit), and writes the record where `output` is set.
/// A fit that does not converge is a result (status); throws Error for bad input, FitInterrupted
/// where it was interrupted with evaluations kept, Interrupted otherwise.
/// Of a study of trials that scatter (study.repeat) see study/repeat.h: here it has one value for
/// all.
StudyFit Fit(const data::Study& study, const FitStudyOptions& options = {});

/// The same in two parts, for a caller who has several to fit: ready to be fitted, its inputs read
/// and hashed;
StudyFit Prepare(const data::Study& study, const FitStudyOptions& options);
/// and fitted, on the evaluations that `journal` holds, to which it adds; null: none. `where`
/// carries out what it does not hold; null: threads. Writes no fit.
void RunPrepared(const data::Study& study, const FitStudyOptions& options, data::Journal* journal,
                 correlate::Workers* where, StudyFit* fit);

/// The problems that Fit, or FitRepeat where study.repeat.wanted, would fit, ready for
/// evaluations, and what `where` of the options gets with them.
struct StudyProblems {
  std::vector<StudyFit> fits;                          ///< own the problems
  std::vector<const correlate::FitProblem*> problems;  ///< in `fits`, in order
  std::string identity;                                ///< of what answers depend on
};
/// Reads all that they need. Throws Error.
StudyProblems ProblemsOf(const data::Study& study, const FitStudyOptions& options);

/// Trial and model at the estimate of a fit, side by side. Without errors where the model fails,
/// and for a trial without marks.
correlate::Comparison CompareAtEstimate(const correlate::FitTrial& trial,
                                        const data::FitRecord& record);

}  // namespace unfurl::study
