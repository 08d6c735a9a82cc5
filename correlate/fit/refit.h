#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "correlate/fit/fit.h"
#include "correlate/fit/held_out.h"

namespace unfurl::correlate {

/// What a refit may cost. Counted in runs, not in seconds: a result depends on no machine.
struct RefitOptions {
  std::size_t runs = 30;  ///< of the cheap model, for each trial
  std::size_t looks = 4;  ///< at the finest rung, for each trial
  /// Ends when the linear model says that this part of a standard error is left to go [-].
  double step_tolerance = 0.1;
  bool look_first = false;  ///< nothing is known beforehand of what the finest rung adds
  std::size_t workers = 0;  ///< evaluations at a time; 0: all cores

  /// Throws Error, placed at the option, for what is out of its range.
  void Check() const;
};

/// How a refit ended.
enum class RefitStatus {
  kSettled,
  kBudget,      ///< before it settled, the runs were used up
  kNotAligned,  ///< the version and the data share nothing
  kFailed,      ///< the version could not be evaluated where the fit came out
};

/// Where the version of a fitted problem came out.
struct Refitted {
  RefitStatus status = RefitStatus::kFailed;
  std::string message;
  std::vector<double> theta;     ///< of the version's parameters, in its order [units]
  std::vector<Registration> at;  ///< by trial
  /// By trial and parameter: of the predictions, per unit of the parameter.
  std::vector<std::vector<Change>> change;
  std::vector<Eigen::VectorXd> residual;  ///< by trial, in the samples' own sigmas [-]
  /// By trial and mark, as ResidualsInModelFrame [m].
  std::vector<std::vector<Eigen::Matrix3Xd>> metres;
  std::vector<std::shared_ptr<const Prediction>> prediction;  ///< by trial, of the finest rung
  /// The same whitened by the noise that the fit found [-].
  std::vector<Eigen::VectorXd> whitened;
  double prior_squares = 0.0;  ///< of what is known of the parameters beforehand [-]
  /// Of the sum of squares, what no values of the parameters within their bounds take away, as far
  /// as the linear model about the end tells, that held to the most that a step has gained over its
  /// promise [0, 1].
  double least = 1.0;
  /// By how much a tighter tolerance changes the sum of squares, where it differs from the fit's
  /// own by so much that something rests on it [-].
  double scatter = 0.0;
  double rows = 0.0;  ///< of data [-]
  /// By parameter: by how much the fitted rows change with one standard error of it, all others
  /// following, RMS in the samples' own sigmas [-].
  std::vector<double> moves;
  HeldOut held_out;                 ///< how well each stretch of time is predicted by the others
  std::size_t runs = 0, looks = 0;  ///< that were made, over all trials
};

/// Fits of versions of a fitted problem that differ from it by an effect or two, from where it came
/// out, with the noise, weights and gross errors that it found. The sensitivities that it ended
/// with lead the way, kept up by Broyden's updates [Broyden 1965], and are taken anew only where
/// they do not lead on: a step is one run where differences take p more.
///
/// It looks for no other minimum, except that a version whose start lies far from the data is laid
/// beside them anew.
class Refits {
 public:
  /// `problem`, `fit` and `judge` must outlive it; the fit must be usable. `judge`: a fit to the
  /// same data whose noise, weights and gross errors are believed; null: `fit` itself. Throws Error
  /// where the judge has another number of trials.
  Refits(const FitProblem& problem, const FitResult& fit, const FitOptions& options,
         const FitResult* judge = nullptr);

  /// `version`: the same trials; parameters of the same names, or fewer. Its `model` is the one to
  /// search with; the last of its rungs, where it has any, the one that is meant: it is looked at
  /// where the search ends, what it adds there is added to the model, and so on until that changes
  /// nothing. Throws Error for another number of trials, a parameter that the problem has not.
  Refitted Refit(const FitProblem& version, const RefitOptions& options) const;

  /// From now on refits begin where that of the problem itself came out. Throws Error for one of
  /// another number of parameters or trials, or that came to none.
  void GoOnFrom(const Refitted& own);

 private:
  const FitProblem& problem_;
  FitOptions options_;
  std::vector<double> theta_;                // where refits begin [units]
  std::vector<Registration> at_;             // by trial
  std::vector<std::vector<Change>> change_;  // by trial and parameter, per unit of it
  double squares_ = 0.0;                     // of the residuals there, whitened [-]
  double model_noise_ = 0.0;                 // in sigmas of the data [-]
  std::vector<Observations> weighed_;        // by trial, as the fit left them
  std::vector<RowWhitening> whitening_;      // by trial
};

}  // namespace unfurl::correlate
