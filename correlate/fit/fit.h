#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "correlate/align/align.h"
#include "correlate/align/nuisance.h"
#include "correlate/align/stated.h"
#include "correlate/fit/between_samples.h"
#include "correlate/fit/clock_drift.h"
#include "correlate/fit/evaluator.h"
#include "correlate/fit/fit_problem.h"
#include "correlate/fit/goodness.h"
#include "correlate/fit/gross_samples.h"
#include "correlate/fit/interval.h"
#include "correlate/fit/parameter.h"
#include "correlate/fit/profile.h"
#include "correlate/fit/progress_workers.h"
#include "correlate/fit/series_noise.h"

namespace unfurl::correlate {

// Several starts: a Latin hypercube over the bounds (of the logarithm where that is what moves),
// each point simulated over the first horizon and laid over the data; from the best of them the
// fit is carried on, and the best end is the answer. What the first stage leaves open (clearance,
// while nothing has struck yet) is scattered anew over its bounds before the second.
struct SearchOptions {
  // Points of the hypercube, beside the study's own start. kAsNeeded: none, unless the search from
  // the start ends where the residuals are far above the data's sigmas.
  static constexpr int kAsNeeded = -1;
  int screened = kAsNeeded;
  int starts = 1;  // that are carried on
  // Starts that the first stage leads to the same minimum are carried on as one, and its minima are
  // not scattered anew over what they leave open: for motions with a minimum at each alias.
  bool distinct = false;
  std::uint64_t seed = 1;  // of the hypercube
  // By trial: the offset at which the way begins [s]; empty: an alignment finds it.
  std::vector<double> places;
};

/// How a fit searches, and what it tests.
struct FitOptions {
  AlignOptions align;
  // Ends of a growing horizon on the model's clock [s], rising: each stage fits the data up to its
  // end, starting where the one before came out, so that the early motion, which is simple,
  // brings the parameters near before the late motion, which repeats every impact's error, is
  // looked at. The last stage is always the whole record. Empty: that alone.
  std::vector<double> stages;
  // Instead: to just before the first impact that the data show, then beyond it by six samples, and
  // by 1.6 times as much each time, so that no stage adds more impacts than the one before it has
  // put in their places.
  bool stages_by_impacts = false;
  // By stage (the last one's beyond the list): names of the parameters that it moves; empty: all.
  std::vector<std::vector<std::string>> free;
  SearchOptions search;
  int max_iterations = 25;  // of the solver, per stage
  // A stage ends when the next step would move every parameter by less than this part of its
  // standard error [-].
  double step_tolerance = 0.05;
  // Differences move the data by this part of their sigma, RMS, or by `noise_factor` times the
  // model's own noise, whichever is more [-].
  double difference_sigma = 0.1;
  double noise_factor = 30.0;
  // Residuals that follow one another are whitened by the noise found in them, and the fit is
  // sharpened with that, unless they are more than twice the marks' sigma: then they are the
  // model's error and no noise. Off: the plain estimate; its errors are corrected all the same.
  bool whiten = true;
  // Samples that the data themselves show to be gross errors count for next to nothing. Off: all
  // count as their covariances say.
  bool robust = true;
  // What clocks differ by, of which nothing is said beforehand: the standard deviation of the drift
  // where the data call for one [-]. Crystals keep 1e-4; what is set by hand or by RC, 1e-3 and
  // less.
  double clock_sigma = 1e-3;
  // Sections, in time, over which the model's own error is taken for one common shape each, and
  // whose weight is looked at one by one.
  int error_sections = 8;
  ProfileOptions profile;
  std::size_t workers = 0;   // 0: all cores
  Workers* where = nullptr;  // what carries evaluations out; null: threads, `workers` of them
  std::function<void(const FitProgress&)> progress;  // from any thread

  // Throws Error, placed at the option, for what is out of its range.
  void Check() const;
};

enum class FitStatus {
  kConverged,
  kNotAligned,    // the data and the model at the start share nothing
  kModelFailed,   // the model could not be evaluated at the start
  kNotConverged,  // the solver gave up, or a profile still holds a lower point
};
const char* Name(FitStatus status);

enum class Verdict {
  kDetermined,
  kMeshLimited,  // known, but the model's own error counts for more than the data's
  kCombination,  // determined only together with others
  kAtBound,
  kNotDetermined,  // standard error above half of the value
  kIfModelHolds,   // would be known, but the model does not explain the data
};
const char* Name(Verdict verdict);  // in words

/// A fitted parameter; [unit] is the parameter's.
struct ParameterEstimate {
  double value = 0.0;        // [unit]
  double sigma = 0.0;        // standard error, all parts together [unit]
  double sigma_data = 0.0;   // from samples and what they share, with residual correlation [unit]
  double sigma_white = 0.0;  // the same, were residuals white, their covariances right [unit]
  double sigma_model = 0.0;  // from the model's own error (mesh, tolerance) [unit]
  double sigma_doubt = 0.0;  // of that, what lies to either side; the rest is between 0 and
                             // model_shift (FitResult::ladder.one_sided); else all of it [unit]
  double sigma_alone = 0.0;  // of the data, were all other parameters known [unit]
  double model_shift = 0.0;  // by how much the finer model would move the value [unit]
  double kink = 0.0;         // |forward - backward| / |forward + backward| differences, RMS [-]
  double imitated = 0.0;     // share of its effect that frame, offset or calibration imitate [0, 1]
  Profile profile;           // without points: none was asked for
  Interval data95;           // of the data alone [unit]
  Interval all95;            // of the data and of the model's own error [unit]
  Verdict verdict = Verdict::kNotDetermined;
  std::string reason;             // in words, with numbers
  std::vector<std::string> with;  // names, for kCombination
};

/// How one stage of the search went.
struct StageResult {
  double end = 0.0;           // [s]; infinity: all
  std::vector<double> theta;  // values [units]
  double cost = 0.0;          // half the sum of squares [-]
  int iterations = 0;
  std::size_t samples = 0;
  std::string solver_message;
};

// One of several starts and where it led.
struct StartResult {
  std::vector<double> from, to;  // values [units]
  double screened = 0.0;         // misfit over the first horizon that it was chosen by [-]
  double cost = -1.0;            // half the sum of squares over the whole record; -1: failed [-]
  std::string message;
  std::vector<StageResult> stages;
};

// A part of the record in which the model's own noise is not small beside the marks' sigma, as
// after many impacts: it counts less.
struct LessWeight {
  std::string mark;
  double from = 0.0, to = 0.0;  // on the record's clock [s]
  double noise = 0.0;           // RMS of a coordinate [m]
  double weight = 1.0;          // (0, 1), of the samples there [-]
};

// What the model's own error at the estimate was judged by.
enum class ErrorCheck {
  kNone,       // by nothing: the standard errors are those of the data alone
  kTolerance,  // by a tighter tolerance of the solver; not by a finer mesh
  kLadder,     // by the change between the finest rungs of a ladder
  kFiner,      // by a model with less discretisation error, and a tighter tolerance
};

// What belongs to one trial, at the estimate.
struct TrialResult {
  std::string name;
  Alignment alignment;  // at the start that led here
  Registration at;
  RegistrationFit registration;  // rows whitened in time, too
  Eigen::VectorXd residual;      // in the samples' own sigmas [-]
  std::vector<Nuisance> nuisances;
  Eigen::VectorXd nuisance_sigma;  // standard errors, all parts [rad, m, s, -]
  ResidualKinds kinds;             // with the noise that channels without a stated one show
  Prediction prediction;           // at observations.StampsAt(reference)
  Clock reference;
  std::vector<Change> change;  // of the prediction per unit of each parameter
  // Standard error of the predicted marks by the parameters', all parts, per mark 3 x n [m].
  std::vector<Eigen::Matrix3Xd> band;
  /// What one standard deviation of each direction of the calibration's error shifts the values by,
  /// p x k [unit]: the same directions in all trials of one calibration.
  Eigen::MatrixXd calibration_shift;
  GrossErrors gross;                        // samples put aside
  std::vector<ChannelGross> channel_gross;  // readings put aside
  DriftTest drift;                          // whether the data call for a drift of the clock
  SeriesNoise noise;                        // found in the residuals, with which they are whitened
  ResidualNoise plain;                      // the residuals before that: autocorrelation, whiteness
  ResidualNoise whitened;                   // and after
  double chi2_per_dof = 0.0;                // of residuals in the samples' own sigmas [-]
  GoodnessOfFit goodness;                   // does the model explain them?
  BetweenSamples between;    // looked at where residuals have no stated size, or another one
  double model_noise = 0.0;  // RMS scatter of the model's marks, one tolerance to another [m]
  std::vector<LessWeight> less_weight;
  ErrorCheck error_check = ErrorCheck::kNone;
  std::string error_check_failure;  // why the better model that was asked gave nothing
  std::vector<Change> rivals;       // by FitTrial::rivals: what each changes; empty: it failed
  // The model's own error at the estimate (better model less model, times the factor); empty where
  // no better one was run. RMS of the marks, below.
  Change model_error;
  // By how much a second estimate of it, from lower rungs of the ladder, differs; empty: none.
  Change model_doubt;
  // What a tighter tolerance moves the lowest rung by there; empty: none was run.
  Change model_scatter;
  double model_error_rms = 0.0;     // [m]
  double model_error_sigmas = 0.0;  // in the samples' sigmas [-]
  double data_sigma = 0.0;          // typical sigma of the samples [m]
};

/// One look of a fit's ladder at the finest rung (docs/physics-correlation.md, "The ladder").
struct LadderRound {
  std::size_t base = 0;       ///< the rung that led there
  std::vector<double> theta;  ///< values at which the finest rung was evaluated [units]
  double fine_cost = -1.0;    ///< half its sum of squares there; -1: it failed [-]
  /// From the round before, the largest in standard errors; NaN: the first [-].
  double step = std::numeric_limits<double>::quiet_NaN();
  /// That step over the one before it; NaN: there is none [-].
  double contraction = std::numeric_limits<double>::quiet_NaN();
  bool counted = true;  ///< the finest rung's cost fell
  bool slope = false;   ///< the difference's slope took it in (Broyden)
};

/// What the ladder of a fit did.
struct LadderResult {
  bool used = false;                ///< there were rungs
  bool settled = false;             ///< the last step was small, or the last rung was fitted itself
  std::size_t base = 0;             ///< the rung that was solved on in the end
  std::vector<std::string> names;   ///< of the rungs, the lowest first
  std::vector<std::size_t> runs;    ///< evaluations of each, over all trials
  std::vector<LadderRound> rounds;  ///< the looks, in their order
  std::vector<std::string> notes;   ///< in words: what went up, and why
  /// Rounds in which what the finest rung leaves was followed from the end of its first order,
  /// each a run of the finest rung a trial; 0: the shift is short, and its first order stands.
  int followed = 0;
  /// Whether two estimates of what the finest rung leaves agree, so that its direction is known.
  bool one_sided = false;
  /// What it leaves is more than ten times what the data leave open of any parameter: no profile of
  /// the data would show in an interval (less than half a per cent of it), and none was followed.
  bool rules = false;
};

/// Another place in time at which the data are explained, with values of their own; or other values
/// at the same place, between which the samples do not tell.
struct OtherClock {
  std::vector<double> offset;  ///< by trial [s]
  std::vector<double> theta;   ///< the best values there [units]
  double deviance = 0.0;       ///< above that of the estimate [-]
  bool elsewhere = true;       ///< false: at the same offsets
};

/// Whether a fit that did not explain its data looked for another minimum, and found one.
enum class Elsewhere { kNotLooked, kNothing, kFound };

/// All that a fit found.
struct FitResult {
  FitStatus status = FitStatus::kModelFailed;
  std::string message;
  /// The estimate may be believed, within its errors.
  bool Usable() const { return status == FitStatus::kConverged; }

  std::vector<ParameterEstimate> parameters;
  /// Of all of them [units].
  std::vector<double> Theta() const;
  Eigen::MatrixXd covariance;        // of the values, all parts [unit x unit]
  Eigen::MatrixXd covariance_model;  ///< of that, the part of the model's own error [unit x unit]
  Eigen::MatrixXd correlation;       // likewise [-]
  std::vector<StartResult> starts;   // best end first; one that failed comes last
  std::vector<StageResult> stages;   // of the start that led to the estimate, sharpening included
  std::vector<TrialResult> trials;
  std::vector<EvaluationRecord> evaluations;
  // Whitened rows of all trials x parameters: d residual / d value [1/unit].
  Eigen::MatrixXd sensitivity;
  double cost = 0.0;  // half the sum of squares at the estimate, whitened, with priors [-]
  // Deviance by which the lowest point of any profile lies below the estimate; 0: none does [-].
  double profile_below = 0.0;
  /// Priors, of parameters and of what belongs to trials, held against the data.
  std::vector<Stated> stated;
  LadderResult ladder;
  Elsewhere elsewhere = Elsewhere::kNotLooked;
  // Those that the data do not tell from the estimate's; a motion that repeats itself has some.
  std::vector<OtherClock> other_clocks;
  int returns = 0;  // how often the fit was taken up again from a lower point of a profile
};

// Trust region with bounds (Ceres) over the parameters, everything else projected out, from one or
// several starts. A failed evaluation is recorded and the solver turns back from it. The result
// depends on the problem and the options alone, not on the number of workers or their order.
FitResult Fit(const FitProblem& problem, const FitOptions& options = {});

}  // namespace unfurl::correlate
