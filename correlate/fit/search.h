#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "correlate/fit/fit.h"
#include "correlate/fit/reduced_problem.h"
#include "correlate/fit/screening.h"
#include "correlate/fit/solver.h"

namespace unfurl::correlate {

// Of a standard error: how near to its minimum a solution that only leads the way has to come.
inline constexpr double kLeadingTolerance = 0.5;

// Samples of each trial in a horizon: a shorter one leads nowhere.
std::size_t FewestOfHorizon(const FitProblem& problem, const FitOptions& options);

// The data of every trial up to a horizon, and the solver's place among them.
class StageRunner {
 public:
  StageRunner(const FitProblem& problem, const FitOptions& options, const Candidate& from,
              Workers& workers, int start);

  // Stages that lead the way, each to within half a standard error; the last is the whole record.
  // False: a model failed there, see message().
  // `most_iterations`: of this solution; 0: as the options say.
  std::size_t stages() const { return ends_.size(); }
  bool Lead(std::size_t stage, int most_iterations = 0);
  // The only start: its last stage ends as soon as its slopes foretell the steps, and the solution
  // that follows does the rest.
  void LeadAlone() { alone_ = true; }
  bool alone() const { return alone_; }
  // Where differences to either side disagree, slopes lead into the next small hollow and no
  // further: points drawn about the best place, the best quarter of which says where to draw next
  // (cross-entropy [Rubinstein 1999]), find the floor of the valley. Does nothing to a model that
  // is smooth. False: a model failed at the best place. `beside`: to be asked for in one batch with
  // the differences that tell.
  bool Polish(const std::vector<Evaluator::Request>& beside = {});
  // To within the step tolerance, over the whole record, with this whitening and these
  // observations (by trial; null: as they are), until the time offsets have settled.
  bool Sharpen(const std::vector<const Observations*>& observations,
               const std::vector<const RowWhitening*>& whitening, const std::string& what);

  // The steps of Sharpen, for whoever does something between them. Place: new stamps where the time
  // offsets have moved; false: there are. SolveHere: false: a model failed at the start.
  bool Place(const std::vector<const Observations*>& observations,
             const std::vector<const RowWhitening*>& whitening);
  // `verify`: the solution stands on slopes that were bought there.
  bool SolveHere(const std::string& what, bool verify = true) {
    return SolveHere(what, options_.step_tolerance, verify);
  }
  bool SolveHere(const std::string& what, double tolerance, bool verify);
  bool Settled() const;  // the clocks are near those of the stamps
  // Standard errors of u by the last solution, the floor in them.
  Eigen::VectorXd sigma() const;

  // Points of the hypercube with what this stage's data determine kept where it is; none where they
  // leave nothing open.
  std::vector<std::vector<double>> ScatterOpen(const std::vector<std::vector<double>>& hypercube);
  // Half the sums of squares at these values over the data of a stage; infinite where a model
  // fails.
  std::vector<double> CostsAt(const std::vector<std::vector<double>>& theta, std::size_t stage);
  // Goes there, with frame and clock as they are.
  void MoveTo(const std::vector<double>& theta, const StageRunner& from);
  // Where the values are known beforehand to be no better than this, in u: steps are then judged by
  // it, too.
  void SetFloor(Eigen::VectorXd floor) { floor_ = std::move(floor); }
  void GoTo(const std::vector<double>& u) { u_ = u; }
  // Goes there within the problem that stands.
  void Restart(const std::vector<double>& theta);

  StartResult& result() { return result_; }
  const StartResult& result() const { return result_; }
  const std::vector<double>& u() const { return u_; }
  FitStatus status() const { return status_; }
  const std::string& message() const { return message_; }
  ReducedProblem& reduced() { return *reduced_; }
  Slopes& slopes() { return slopes_; }
  const ReducedProblem::Point& point() const { return point_; }
  Evaluator& evaluator() { return evaluator_; }
  const Candidate& candidate() const { return from_; }
  double misfit() const { return misfit_; }  // mean square of the last stage's residuals
  // By trial, in sigmas of the data.
  void SetModelNoise(std::vector<double> noise) { model_noise_ = std::move(noise); }
  std::function<void(double cost, const std::vector<double>& theta)> on_best;

 private:
  void Build(const std::vector<const Observations*>& observations,
             const std::vector<const RowWhitening*>& whitening, bool keep_clocks, int stage);
  // The data up to a stage's end; the number of samples.
  std::size_t BuildStage(std::size_t stage);
  SolverOptions OptionsOfSolver(double tolerance, bool central,
                                const std::vector<std::string>& free) const;
  bool SolveStage(const StageResult& named, const SolverOptions& how);
  double HorizonEnd(std::size_t trial, double end) const;
  void FindEnds();
  // The steps of Polish.
  bool IsRough(const std::vector<Evaluator::Request>& beside);
  void Draw();

  const FitProblem& problem_;
  const FitOptions& options_;
  const Candidate& from_;
  Evaluator evaluator_;
  std::vector<double> ends_;         // of the stages, on the model's clock; the last: infinity [s]
  std::vector<Registration> at_;     // by trial
  std::vector<Clock> reference_;     // by trial; of the stamps that stand
  std::vector<double> model_noise_;  // by trial, in sigmas of the data [-]
  std::vector<std::unique_ptr<Observations>> cut_;
  std::unique_ptr<ReducedProblem> reduced_;
  Slopes slopes_;
  ReducedProblem::Point point_;
  std::vector<double> u_, steps_;
  Eigen::VectorXd sigma_, floor_;
  double misfit_ = 0.0;
  StartResult result_;
  FitStatus status_ = FitStatus::kModelFailed;
  std::string message_;
  int last_stage_ = 0;
  bool alone_ = false;
};

}  // namespace unfurl::correlate
