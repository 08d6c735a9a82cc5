#include "correlate/fit/solver.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <utility>

#include "base/log_silence.h"

namespace unfurl::correlate {

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Of what a step changed, or of the last step: slopes that had not foretold more than this, or that
// leave more than this, are bought anew. Until then each step costs one run and leaves at most this
// part of what is left.
constexpr double kCarries = 0.3;

class ReducedCost : public ceres::CostFunction {
 public:
  ReducedCost(ReducedProblem& problem, const SolverOptions& options, Slopes& slopes,
              std::size_t parameters)
      : problem_(problem), options_(options), slopes_(slopes), count_(parameters) {
    set_num_residuals(static_cast<int>(problem.rows()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(parameters));
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    try {
      const std::vector<double> u(parameters[0], parameters[0] + count_);
      ReducedProblem::Point point;
      if (!problem_.At(u, &point, "trial")) return false;
      Eigen::Map<Eigen::VectorXd>(residuals, problem_.rows()) = point.residual;
      if (jacobians == nullptr || jacobians[0] == nullptr) return true;
      Eigen::MatrixXd J, projected;
      if (!SlopesAt(u, point, &J, &projected)) return false;
      Take(u, point, J, std::move(projected));
      Eigen::Map<RowMajor>(jacobians[0], problem_.rows(), static_cast<Eigen::Index>(count_)) =
          last_projected;
      return true;
    } catch (...) {
      // Not through the solver: Interrupted is thrown again when it has returned.
      if (!error) error = std::current_exception();
      return false;
    }
  }

  // What the last solution stands on: slopes bought where it ended. False: a column failed.
  bool Verify() {
    ReducedProblem::Point point;
    if (!problem_.At(last_u, &point, "trial") || !slopes_.Buy(problem_, last_u, point)) {
      return false;
    }
    const Eigen::MatrixXd J = slopes_.Rows(problem_);
    Take(std::vector<double>(last_u), point, J, problem_.Project(point, J));
    return true;
  }
  // A new solution begins.
  void Begin() {
    first_ = true;
    foretold_ = false;
  }
  bool fresh() const { return bought_; }
  // The last step was, by the slopes that led to it.
  bool foretold() const { return foretold_; }

  mutable std::vector<double> last_u;
  mutable Eigen::VectorXd last_residual;
  mutable Eigen::MatrixXd last_projected;
  mutable bool by_value = true;  // how logarithms are stepped
  mutable std::exception_ptr error;

 private:
  // And without what registrations imitate.
  bool SlopesAt(const std::vector<double>& u, const ReducedProblem::Point& point,
                Eigen::MatrixXd* J, Eigen::MatrixXd* projected) const {
    if (std::exchange(first_, false)) {
      slopes_.StartAt(problem_, u, point);
      last_step_ = std::numeric_limits<double>::infinity();
      // One-sided differences lead the way; at the end their bias would hold the solver off the
      // minimum wherever the residuals are large.
      if (!slopes_.known() && !options_.central_from_start) {
        bought_ = true;
        ReducedProblem::Changes change;
        if (!problem_.Sensitivity(u, point, +1, J, &change)) return false;
        problem_.SetSteps(u, *J, point, options_.difference_target);
        *projected = problem_.Project(point, *J);
        if (options_.leads) {
          slopes_.Take(std::move(change), u, point);
          last_step_ = LengthOfStep(u, *projected, point.residual);
        }
        return true;
      }
    } else if (slopes_.known()) {
      slopes_.MoveTo(problem_, u, point, options_.difference_target);
    }
    auto rows = [&] {
      *J = slopes_.Rows(problem_);
      *projected = problem_.Project(point, *J);
      return LengthOfStep(u, *projected, point.residual);
    };
    bool carried = slopes_.known() && slopes_.mismatch() <= kCarries;
    double next = carried ? rows() : 0.0;
    // Nor where the next step is hardly shorter than the last.
    carried = carried && (slopes_.fresh() || next <= kCarries * last_step_);
    foretold_ = carried && !slopes_.fresh();
    if (!carried) {
      if (!slopes_.Buy(problem_, u, point)) return false;
      next = rows();
    }
    bought_ = slopes_.fresh();
    last_step_ = next;
    return true;
  }

  // The largest part of the next step, in standard errors.
  double LengthOfStep(const std::vector<double>& u, const Eigen::MatrixXd& projected,
                      const Eigen::VectorXd& residual) const {
    const GaussNewton next = StepWithin(problem_.parameters(), u, projected, residual);
    double longest = 0.0;
    for (Eigen::Index j = 0; j < next.step.size(); ++j) {
      if (next.sigma(j) > 0.0) longest = std::max(longest, std::abs(next.step(j)) / next.sigma(j));
    }
    return longest;
  }

  void Take(const std::vector<double>& u, const ReducedProblem::Point& point,
            const Eigen::MatrixXd& J, Eigen::MatrixXd projected) const {
    last_u = u;
    last_residual = point.residual;
    last_projected = std::move(projected);
    // Of what frame, offset or calibration imitate, differences leave noise alone: the solver
    // would follow it from bound to bound.
    constexpr double kImitated = 1e-4;
    for (Eigen::Index j = 0; j < J.cols(); ++j) {
      if (last_projected.col(j).norm() <= kImitated * J.col(j).norm()) {
        last_projected.col(j).setZero();
      }
    }
    HoldAtBounds(u);
  }

  // What presses against its bound stays there, and the others move as if it were given: steps that
  // are cut back at the bound lead along it by inches.
  void HoldAtBounds(const std::vector<double>& u) const {
    constexpr double kNear = 0.02;  // of a standard error: below what ends a stage
    const GaussNewton next = StepWithin(problem_.parameters(), u, last_projected, last_residual);
    for (Eigen::Index j = 0; j < last_projected.cols(); ++j) {
      const auto i = static_cast<std::size_t>(j);
      const double low = StepToLowest(problem_.parameters()[i], u[i]);
      const double high = StepToHighest(problem_.parameters()[i], u[i]);
      const double near = kNear * next.sigma(j), step = next.step(j);
      // Where all others are at their best, too: by its own slope it may lead inwards yet.
      constexpr double kMost = 0.5;  // of so short a way, and at a bound none: it ends there
      const bool at_low = -low < near && step <= kMost * low;
      const bool at_high = high < near && step >= kMost * high;
      if (at_low || at_high) last_projected.col(j).setZero();
    }
  }

  ReducedProblem& problem_;
  const SolverOptions& options_;
  Slopes& slopes_;
  std::size_t count_;
  mutable bool first_ = true, bought_ = false, foretold_ = false;
  mutable double last_step_ = std::numeric_limits<double>::infinity();  // [standard errors]
};

class StepWatch : public ceres::IterationCallback {
 public:
  StepWatch(const ReducedCost& cost, const std::vector<Parameter>& parameters,
            const SolverOptions& options)
      : cost_(cost), parameters_(parameters), options_(options) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    if (cost_.error) return ceres::SOLVER_ABORT;
    if (options_.on_iteration) options_.on_iteration(summary.cost, cost_.last_u);
    double tolerance = options_.step_tolerance;
    if (!summary.step_is_successful && summary.iteration > 0) {
      cost_.by_value = !cost_.by_value;
      if (!cost_.fresh()) {
        stale = true;
        return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
      }
      // A step of less than a standard error that does not lead down: the model's own roughness.
      constexpr double kRough = 1.0;
      if (++unsuccessful < 2) return ceres::SOLVER_CONTINUE;
      tolerance = kRough;
    } else {
      unsuccessful = 0;
    }
    foretold = options_.leads && summary.step_is_successful && cost_.foretold();
    small = Small(tolerance) || foretold;
    return small ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

  // Whether the next step is a small part of every standard error.
  bool Small(double tolerance) const {
    const GaussNewton next =
        StepWithin(parameters_, cost_.last_u, cost_.last_projected, cost_.last_residual);
    for (std::size_t j = 0; j < parameters_.size(); ++j) {
      const auto i = static_cast<Eigen::Index>(j);
      if (!options_.held.empty() && options_.held[j]) continue;
      const double floor = options_.floor.size() > i ? options_.floor(i) : 0.0;
      if (std::abs(next.step(i)) > tolerance * std::hypot(next.sigma(i), floor)) return false;
    }
    return true;
  }

  std::string Words(const std::string& otherwise) const {
    if (foretold) return "the last step was foretold: what follows goes on from here";
    return small ? "the next step is a small part of every standard error" : otherwise;
  }

  bool stale = false;  // carried slopes did not lead down
  bool small = false;
  bool foretold = false;
  int unsuccessful = 0;

 private:
  const ReducedCost& cost_;
  const std::vector<Parameter>& parameters_;
  const SolverOptions& options_;
};

constexpr double kFall = 0.9;  // of a logarithm's value in one step: an order of magnitude at most

// Where a step of a logarithm leads that stays one. Within one it is what it is. Beyond, its slope
// tells no more than what is added to the value: of a damping that is far too small, 20 means 21
// times as much and not e^20.
double RiseOfLogarithm(double step) {
  const double size = std::abs(step);
  return size <= 1.0 ? step : std::copysign(std::max(1.0, std::log1p(size)), step);
}

double StepOfRise(double rise) {
  const double size = std::abs(rise);
  return size <= 1.0 ? rise : std::copysign(std::expm1(size), rise);
}

// Logarithms are stepped by the value: what imitates others adds to them, as dampings do. Where
// that has not led down, as logarithms: they may multiply, as a stiffness and a scale do.
class Steps : public ceres::Manifold {
 public:
  Steps(const std::vector<Parameter>& parameters, const std::vector<bool>& held,
        const bool& by_value)
      : parameters_(parameters), by_value_(by_value) {
    for (std::size_t j = 0; j < parameters.size(); ++j) {
      if (held.empty() || !held[j]) free_.push_back(j);
    }
  }

  int AmbientSize() const override { return static_cast<int>(parameters_.size()); }
  int TangentSize() const override { return static_cast<int>(free_.size()); }

  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    // The other values go as far as the logarithm that comes first to where it is not to fall
    // below: had they gone the whole way, they would make up for what it has not done.
    double part = 1.0;
    for (std::size_t k = 0; k < free_.size(); ++k) {
      if (ByValue(free_[k]) && delta[k] * part < -kFall) part = -kFall / delta[k];
    }
    std::copy_n(x, parameters_.size(), x_plus_delta);
    for (std::size_t k = 0; k < free_.size(); ++k) {
      const double by = part * delta[k];
      const bool log = parameters_[free_[k]].log;
      x_plus_delta[free_[k]] += ByValue(free_[k]) ? std::log1p(by) : log ? RiseOfLogarithm(by) : by;
    }
    return true;
  }

  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    for (std::size_t k = 0; k < free_.size(); ++k) {
      const double by = y[free_[k]] - x[free_[k]];
      const bool log = parameters_[free_[k]].log;
      y_minus_x[k] = ByValue(free_[k]) ? std::expm1(by) : log ? StepOfRise(by) : by;
    }
    return true;
  }

  bool PlusJacobian(const double* /*x*/, double* jacobian) const override {
    Chosen(TangentSize(), true, jacobian);
    return true;
  }

  bool MinusJacobian(const double* /*x*/, double* jacobian) const override {
    Chosen(AmbientSize(), false, jacobian);
    return true;
  }

 private:
  bool ByValue(std::size_t j) const { return by_value_ && parameters_[j].log; }

  // Row by row; `tall`: as many rows as parameters.
  void Chosen(int columns, bool tall, double* jacobian) const {
    std::fill_n(jacobian, parameters_.size() * free_.size(), 0.0);
    for (std::size_t k = 0; k < free_.size(); ++k) {
      const std::size_t row = tall ? free_[k] : k, column = tall ? k : free_[k];
      jacobian[row * static_cast<std::size_t>(columns) + column] = 1.0;
    }
  }

  const std::vector<Parameter>& parameters_;
  const bool& by_value_;
  std::vector<std::size_t> free_;
};

void SetBounds(const std::vector<Parameter>& parameters, double* u, ceres::Problem* problem) {
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    const int i = static_cast<int>(j);
    if (std::isfinite(parameters[j].low) && (!parameters[j].log || parameters[j].low > 0.0)) {
      problem->SetParameterLowerBound(u, i, ToInternal(parameters[j], parameters[j].low));
    }
    if (std::isfinite(parameters[j].high)) {
      problem->SetParameterUpperBound(u, i, ToInternal(parameters[j], parameters[j].high));
    }
  }
}

void Conclude(const ceres::Solver::Summary& summary, const StepWatch& watch, SolverResult* result) {
  if (summary.IsSolutionUsable() &&
      (watch.small || summary.termination_type == ceres::CONVERGENCE)) {
    result->status = SolverStatus::kConverged;
    result->message = watch.Words(summary.message);
  } else {
    result->status = SolverStatus::kGaveUp;
    result->message = summary.message;
  }
}

}  // namespace

SolverResult Solve(ReducedProblem& problem, const std::vector<Parameter>& parameters,
                   const std::vector<double>& start, const SolverOptions& options) {
  SolverResult result;
  result.u = start;
  Slopes own;
  ReducedCost cost(problem, options, options.slopes != nullptr ? *options.slopes : own,
                   parameters.size());
  StepWatch watch(cost, parameters, options);

  ceres::Problem::Options problem_options;
  problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem ceres_problem(problem_options);
  ceres_problem.AddResidualBlock(&cost, nullptr, result.u.data());
  SetBounds(parameters, result.u.data(), &ceres_problem);
  Steps steps(parameters, options.held, cost.by_value);
  if (steps.TangentSize() == 0) ceres_problem.SetParameterBlockConstant(result.u.data());
  if (steps.TangentSize() > 0) ceres_problem.SetManifold(result.u.data(), &steps);
  ceres::Solver::Options solver;
  solver.minimizer_type = ceres::TRUST_REGION;
  solver.trust_region_strategy_type = ceres::LEVENBERG_MARQUARDT;
  solver.linear_solver_type = ceres::DENSE_QR;
  solver.max_num_iterations = options.max_iterations;
  // With bounds Ceres tries the step by a line search first. One point of it, without gradients, is
  // the trial point itself and costs nothing more; a longer one would spend evaluations.
  solver.line_search_interpolation_type = ceres::BISECTION;
  solver.max_num_line_search_step_size_iterations = 1;
  solver.function_tolerance = 1e-9;
  solver.parameter_tolerance = 1e-10;
  solver.gradient_tolerance = 1e-14;
  solver.logging_type = ceres::SILENT;
  solver.num_threads = 1;  // the parallel work is inside one evaluation
  solver.callbacks.push_back(&watch);
  ceres::Solver::Summary summary;
  const LogSilence silence;
  // What carried slopes led to, or could not lead down from, is looked at with bought ones.
  for (;;) {
    cost.Begin();
    watch.small = watch.stale = false;
    watch.unsuccessful = 0;
    solver.max_num_iterations = options.max_iterations - result.iterations;
    ceres::Solve(solver, &ceres_problem, &summary);
    if (cost.error) std::rethrow_exception(cost.error);
    result.iterations += std::max(0, static_cast<int>(summary.iterations.size()) - 1);
    if (cost.last_u.empty() || cost.fresh() || !(watch.stale || options.verify)) break;
    if (result.iterations >= options.max_iterations || !cost.Verify()) break;
    watch.small = watch.Small(options.step_tolerance);
    if (watch.small) break;
  }

  result.cost = summary.final_cost;
  if (cost.last_u.empty()) {
    result.message = "the model could not be evaluated at the start";
    return result;
  }
  result.sigma = StepAndSigma(cost.last_projected, cost.last_residual).sigma;
  Conclude(summary, watch, &result);
  return result;
}

}  // namespace unfurl::correlate
