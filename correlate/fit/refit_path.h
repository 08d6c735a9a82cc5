#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "correlate/fit/correction.h"
#include "correlate/fit/evaluator.h"
#include "correlate/fit/reduced_problem.h"
#include "correlate/fit/refit.h"

namespace unfurl::correlate {

/// Where a refit begins; by trial.
struct RefitStart {
  std::vector<double> u;  // internal coordinates of the version's parameters
  std::vector<Registration> at;
  ReducedProblem::Changes change;  // of the predictions, per unit of u, by parameter
  std::vector<const Observations*> observations;
  std::vector<const RowWhitening*> whitening;  // null: white
  double squares = 0.0;                        // of the fit's residuals there, whitened [-]
  double difference = 0.1;                     // RMS by which differences move the rows [-]
};

/// The way of one refit. The problem and the options must outlive it.
class RefitPath {
 public:
  RefitPath(const FitProblem& version, const FitOptions& options, const RefitOptions& how,
            RefitStart start);

  RefitStatus Run();

  const std::string& message() const { return message_; }
  const ReducedProblem::Point& point() const { return point_; }  // of the finest rung, at the end
  const std::vector<double>& u() const { return u_; }
  const std::vector<Registration>& at() const { return at_; }
  const ReducedProblem::Changes& change() const { return change_; }
  ReducedProblem& reduced() { return *reduced_; }
  /// d residual / d u at the end, as far as it is known.
  Eigen::MatrixXd Rows() const { return reduced_->RowsOf(u_, point_, change_); }
  /// By what the linear model says that the sum of squares may still fall, within the
  /// parameters' bounds, times the most that a step has gained over its promise [-].
  double LeftToGain() const;
  /// By how much a tighter tolerance changes the sum of squares at the end, where that differs from
  /// the fit's by so much that something rests on it; else 0, and nothing is run [-].
  double Scatter();
  std::size_t runs() const { return runs_; }
  std::size_t looks() const { return looks_; }

 private:
  // A step of the linear model, and what it promises.
  struct Step {
    Eigen::VectorXd by;   // of u
    double gain = 0.0;    // of the sum of squares [-]
    double sigmas = 0.0;  // its largest part in standard errors [-]
  };
  Step StepFrom(const ReducedProblem::Point& point, double damping) const;
  // Whether a step is no longer than that, and gains no more [noise's mean square].
  bool Within(const Step& step, double sigmas, double gain) const;
  // The standard errors of u that the sensitivities give.
  Eigen::VectorXd Sigma(const ReducedProblem::Point& point) const;
  bool Affords(std::size_t runs) const { return runs_ + runs <= budget_; }

  void Place();  // stamps by the clocks that stand
  bool Begin();  // the first point
  enum class Laid { kAnew, kAsBefore, kNowhere };
  Laid LayBeside();   // frame and clock anew
  bool DescendFar();  // of a version that begins far from the data
  enum class Way { kSettled, kBudget };
  Way Descend();
  std::optional<double> Damped(const Step& step, double damping, int* rejected);
  std::optional<RefitStatus> AfterLook(Way way);
  bool FarFromData() const;
  // One step tried; false: it did not lead down.
  bool Try(const Step& step);
  // Whether the slopes have to be the version's own: so much worse than the fit that a verdict
  // rests on what they leave.
  bool SlopesDecide() const;
  void Carry(const std::vector<double>& to);  // slopes, from where it stands
  bool TakeSlopesAnew();
  // The finest rung where the search ended, which is then what the model says there; false: it
  // failed.
  bool Look();
  bool GoBackToBest();

  const FitProblem& version_;
  const FitOptions& options_;
  const RefitOptions& how_;
  std::unique_ptr<Workers> workers_;
  Evaluator evaluator_;
  bool has_top_;
  RefitStart start_;
  std::vector<double> u_;
  std::vector<Registration> at_;
  ReducedProblem::Changes change_;
  std::unique_ptr<ReducedProblem> reduced_;
  ReducedProblem::Point point_;
  std::size_t budget_, runs_ = 0, looks_ = 0;
  std::shared_ptr<Correction> correction_;  // null: none yet at these stamps
  // The best look.
  double best_cost_ = -1.0;
  std::vector<double> best_u_;
  ReducedProblem::Point best_;
  bool fresh_ = false;     // the slopes are those of the version at the point
  double optimism_ = 1.0;  // the most that a step has gained over its promise [-]
  std::string message_;
};

}  // namespace unfurl::correlate
