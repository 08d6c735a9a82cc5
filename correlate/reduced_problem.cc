#include "correlate/reduced_problem.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

namespace unfurl::correlate {

namespace {

constexpr double kFirstStep = 1e-3;   // of the value, before any sensitivity is known
constexpr double kWidestStep = 0.05;  // of the value or of log: differences stay local
constexpr double kNarrowest = 1e-7;

}  // namespace

double TypicalSigma(const Observations& o) {
  double sum = 0.0;
  for (const MarkSeries& m : o.marks) {
    sum += m.cov.row(0).sum() + m.cov.row(3).sum() + m.cov.row(5).sum();
  }
  return std::sqrt(sum / std::max(1.0, 3.0 * static_cast<double>(o.size())));
}

ReducedProblem::ReducedProblem(const Model& model, const std::vector<Parameter>& parameters,
                               const Observations& observations, double offset_ref,
                               const Registration& start, const RegistrationOptions& options,
                               Evaluator& evaluator)
    : model_(model),
      parameters_(parameters),
      observations_(observations),
      offset_ref_(offset_ref),
      start_(start),
      options_(options),
      evaluator_(evaluator) {
  rows_ = 3 * static_cast<Eigen::Index>(observations.size()) + observations.shared_rank;
  for (const Parameter& p : parameters) {
    rows_ += p.has_prior ? 1 : 0;
    const double size = p.log ? 1.0 : std::max(std::abs(p.start), 1e-12);
    steps_.push_back(kFirstStep * size);
  }
}

bool ReducedProblem::At(const std::vector<double>& u, Point* point, const std::string& purpose) {
  const std::vector<double> theta = Values(parameters_, u.data());
  point->prediction = evaluator_.Evaluate({&model_, theta, purpose, false});
  if (point->prediction->status != ModelStatus::kGood) return false;
  point->registration =
      FitRegistration(observations_, *point->prediction, offset_ref_, start_, options_);
  point->residual.setZero(rows_);
  const Eigen::Index data = point->registration.residual.size();
  point->residual.head(data) = point->registration.residual;
  Eigen::Index row = data;
  for (std::size_t j = 0; j < parameters_.size(); ++j) {
    if (!parameters_[j].has_prior) continue;
    point->residual(row++) = (theta[j] - parameters_[j].prior_mean) / parameters_[j].prior_sigma;
  }
  point->cost = 0.5 * point->residual.squaredNorm();
  evaluator_.NoteCost(theta, point->cost);
  if (!std::isfinite(point->cost)) return false;
  start_ = point->registration.at;  // nearer than the first for every later point
  return true;
}

bool ReducedProblem::Shifted(const std::vector<double>& u, std::size_t j, int side,
                             std::vector<double>* moved) const {
  *moved = u;
  (*moved)[j] += side * steps_[j];
  const double inside = ToInternal(parameters_[j], FromInternal(parameters_[j], (*moved)[j]));
  return std::abs(inside - (*moved)[j]) < 1e-3 * steps_[j];
}

bool ReducedProblem::CentralSensitivity(const std::vector<double>& u, const Point& at,
                                        Eigen::MatrixXd* J) {
  std::vector<Evaluator::Request> forward;
  for (std::size_t j = 0; j < u.size(); ++j) {
    std::vector<double> moved;
    if (Shifted(u, j, +1, &moved)) {
      forward.push_back({&model_, Values(parameters_, moved.data()), "difference", false});
    }
  }
  Eigen::MatrixXd other;
  if (!Sensitivity(u, at, -1, J, nullptr, forward) || !Sensitivity(u, at, +1, &other)) return false;
  *J = 0.5 * (*J + other);
  return true;
}

bool ReducedProblem::Sensitivity(const std::vector<double>& u, const Point& at, int sign,
                                 Eigen::MatrixXd* J, Change* change_out,
                                 const std::vector<Evaluator::Request>& beside) {
  const std::size_t p = parameters_.size();
  std::vector<int> side(p, sign);
  std::vector<Evaluator::Request> requests(beside);  // first: they may be the long ones
  std::vector<std::vector<double>> points(p);
  for (std::size_t j = 0; j < p; ++j) {
    std::vector<double> moved;
    if (!Shifted(u, j, side[j], &moved)) {
      side[j] = -side[j];
      Shifted(u, j, side[j], &moved);
    }
    points[j] = moved;
    requests.push_back({&model_, Values(parameters_, moved.data()), "difference", false});
  }
  std::vector<Evaluator::Answer> answers = evaluator_.Evaluate(requests);
  answers.erase(answers.begin(), answers.begin() + static_cast<std::ptrdiff_t>(beside.size()));
  Change change(p);
  for (std::size_t j = 0; j < p; ++j) {
    if (answers[j]->status != ModelStatus::kGood) {  // a recorded failure: try the other side
      side[j] = -side[j];
      std::vector<double> moved;
      if (!Shifted(u, j, side[j], &moved)) return false;
      points[j] = moved;
      answers[j] =
          evaluator_.Evaluate({&model_, Values(parameters_, moved.data()), "difference", false});
      if (answers[j]->status != ModelStatus::kGood) return false;
    }
    const double h = points[j][j] - u[j];
    for (std::size_t m = 0; m < answers[j]->marks.size(); ++m) {
      change[j].push_back((answers[j]->marks[m].p - at.prediction->marks[m].p) / h);
    }
  }
  J->setZero(rows_, static_cast<Eigen::Index>(p));
  const Eigen::MatrixXd data =
      WhitenedSensitivity(observations_, *at.prediction, at.registration.at.X_WM, change);
  J->topRows(data.rows()) = data;
  Eigen::Index row = data.rows();
  for (std::size_t j = 0; j < p; ++j) {
    if (!parameters_[j].has_prior) continue;
    const double value = FromInternal(parameters_[j], u[j]);
    (*J)(row++, static_cast<Eigen::Index>(j)) =
        Slope(parameters_[j], value) / parameters_[j].prior_sigma;
  }
  if (change_out != nullptr) *change_out = std::move(change);
  return true;
}

Eigen::MatrixXd ReducedProblem::Project(const Point& at, const Eigen::MatrixXd& J) const {
  const Eigen::MatrixXd& N = at.registration.jacobian;
  const Eigen::Index data = N.rows();
  if (N.cols() == 0) return J;
  // Unit columns first: rotations, metres and seconds share one normal matrix.
  const Eigen::VectorXd scale = N.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(N.cols(), N.cols());
  normal.selfadjointView<Eigen::Lower>().rankUpdate(N.transpose());
  normal.triangularView<Eigen::StrictlyUpper>() = normal.transpose();
  normal = scale.asDiagonal() * normal * scale.asDiagonal();
  const Eigen::MatrixXd right = scale.asDiagonal() * (N.transpose() * J.topRows(data));
  const Eigen::MatrixXd coefficients = normal.completeOrthogonalDecomposition().solve(right);
  Eigen::MatrixXd out = J;
  out.topRows(data).noalias() -= N * (scale.asDiagonal() * coefficients);
  return out;
}

void ReducedProblem::SetSteps(const Eigen::MatrixXd& J, const Point& at, double target) {
  // Whitened rows times the typical sigma are metres.
  const double metres = TypicalSigma(observations_);
  const double n = std::max(1.0, 3.0 * static_cast<double>(at.registration.known));
  for (std::size_t j = 0; j < parameters_.size(); ++j) {
    const double rms = metres * J.col(static_cast<Eigen::Index>(j)).norm() / std::sqrt(n);
    const double size = parameters_[j].log ? 1.0 : std::max(std::abs(parameters_[j].start), 1e-12);
    const double widest = kWidestStep * size;
    steps_[j] = rms > 0.0 ? std::clamp(target / rms, kNarrowest * size, widest) : widest;
  }
}

}  // namespace unfurl::correlate
