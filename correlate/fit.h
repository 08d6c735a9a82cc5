#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "correlate/align.h"
#include "correlate/evaluator.h"
#include "correlate/parameter.h"

namespace unfurl::correlate {

// What is fitted to what. The models and observations must outlive the call.
struct FitProblem {
  const Model* model = nullptr;
  std::vector<Parameter> parameters;
  const Observations* observations = nullptr;  // unsmoothed, with covariances

  // The same model with less discretisation error, asked once, at the estimate; null: none. What
  // it moves the marks by, times `finer_factor`, is taken for the model's own error: 4/3 where the
  // finer mesh has half the spacing and the error falls with its square.
  const Model* finer = nullptr;
  double finer_factor = 4.0 / 3.0;
};

struct FitProgress {
  int stage = 0;
  int stages = 1;
  std::size_t evaluations = 0;
  double best_cost = 0.0;  // half the sum of squares, of this stage
  std::vector<double> best_theta;
};

struct FitOptions {
  AlignOptions align;
  // Ends of a growing horizon on the model's clock [s], rising: each stage fits the data up to its
  // end, starting where the one before came out, so that the early motion, which is simple,
  // brings the parameters near before the late motion, which repeats every impact's error, is
  // looked at. The last stage is always the whole record. Empty: that alone.
  std::vector<double> stages;
  int max_iterations = 25;  // of the solver, per stage
  // A stage ends when the next step would move every parameter by less than this part of its
  // standard error [-].
  double step_tolerance = 0.05;
  // Differences move the marks by this part of their sigma, RMS, or by `noise_factor` times the
  // model's own noise, whichever is more [-].
  double difference_sigma = 0.1;
  double noise_factor = 30.0;
  // Sections, in time, over which the model's own error is taken for one common shape each.
  int error_sections = 8;
  std::size_t workers = 0;  // 0: all cores
  std::function<void(const FitProgress&)> progress;
};

enum class FitStatus {
  kConverged,
  kNotAligned,    // the data and the model at the start share nothing
  kModelFailed,   // the model could not be evaluated at the start
  kNotConverged,  // the solver gave up
};
const char* Name(FitStatus status);

enum class Verdict {
  kDetermined,
  kMeshLimited,  // known, but the model's own error counts for more than the data's
  kCombination,  // determined only together with others
  kAtBound,
  kNotDetermined,  // standard error above half of the value
};
const char* Name(Verdict verdict);  // in words

struct ParameterEstimate {
  double value = 0.0;
  double sigma = 0.0;        // standard error, all parts together
  double sigma_data = 0.0;   // from the samples and what they share, residual correlation included
  double sigma_white = 0.0;  // the same, were the residuals white and their covariances right
  double sigma_model = 0.0;  // from the model's own error (mesh, tolerance)
  double model_shift = 0.0;  // by how much the finer model would move the value
  double kink = 0.0;         // |forward - backward| / |forward + backward| differences, RMS [-]
  Verdict verdict = Verdict::kNotDetermined;
  std::string reason;             // in words, with numbers
  std::vector<std::string> with;  // names, for kCombination
};

struct StageResult {
  double end = 0.0;  // [s]; infinity: all
  std::vector<double> theta;
  double cost = 0.0;
  int iterations = 0;
  std::size_t samples = 0;
  std::string solver_message;
};

struct FitResult {
  FitStatus status = FitStatus::kModelFailed;
  std::string message;
  bool Usable() const { return status == FitStatus::kConverged; }

  std::vector<ParameterEstimate> parameters;
  Eigen::MatrixXd covariance;  // of the values, all parts [unit x unit]
  Eigen::MatrixXd correlation;
  Alignment alignment;  // at the start
  std::vector<StageResult> stages;
  std::vector<EvaluationRecord> evaluations;

  // At the estimate.
  RegistrationFit registration;
  std::vector<std::string> nuisances;  // names
  Eigen::VectorXd nuisance_sigma;      // standard errors, all parts [rad, m, s, -]
  Prediction prediction;               // at observations.StampsAt(offset_ref)
  double offset_ref = 0.0;
  Eigen::MatrixXd sensitivity;  // whitened rows x parameters, d residual / d value
  // Change of the predicted marks per unit of each parameter, [parameter][mark] 3 x n [m / unit].
  std::vector<std::vector<Eigen::Matrix3Xd>> change;
  ResidualNoise noise;
  double chi2_per_dof = 0.0;
  double model_noise = 0.0;  // RMS scatter the model reports [m]
  // The model's own error at the estimate (finer model less model, times the factor), per mark
  // 3 x n [m]; empty without a finer model. RMS in metres and in the marks' sigmas.
  std::vector<Eigen::Matrix3Xd> model_error;
  double model_error_rms = 0.0;
  double model_error_sigmas = 0.0;
  double data_sigma = 0.0;  // typical sigma of the samples [m]
};

// Local fit from one start: trust region with bounds (Ceres) over the parameters, everything else
// projected out. A failed evaluation is recorded and the solver turns back from it.
FitResult Fit(const FitProblem& problem, const FitOptions& options = {});

}  // namespace unfurl::correlate
