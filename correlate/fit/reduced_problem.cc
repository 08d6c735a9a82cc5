#include "correlate/fit/reduced_problem.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

namespace {

constexpr double kFirstStep = 1e-3;   // of the value, before any sensitivity is known
constexpr double kWidestStep = 0.05;  // of the value or its start: differences stay local
// Of the value: differences over shorter steps, near the root of the machine's precision
// (1.5e-8), are rounding.
constexpr double kNarrowest = 1e-7;

double SizeOf(const Parameter& p) {
  const double range = p.high - p.low;
  if (p.start != 0.0) return std::abs(p.start);
  // A value that starts at zero has its size from its bounds, or its prior (Check asks for one).
  return std::isfinite(range) ? 0.1 * range : p.prior_sigma;
}

// By how much the offset may move before the prediction is asked at new stamps and the stage solved
// again [s]: to this far its velocities carry it, that is until the curvature of a path, by the
// changes of velocity from sample to sample, moves a mark by kPart of the samples' sigma.
double CarriedFor(const Prediction& prediction, double sigma, const Stamps& stamps) {
  constexpr double kPart = 1e-3;  // nothing that an estimate could show
  double steepest = 0.0;          // [m/s^2]
  for (std::size_t m = 0; m < prediction.marks.size(); ++m) {
    const Eigen::Matrix3Xd& v = prediction.marks[m].v;
    const std::vector<double>& t = stamps.t[m];
    for (Eigen::Index i = 1; i < v.cols(); ++i) {
      const double step = t[static_cast<std::size_t>(i)] - t[static_cast<std::size_t>(i - 1)];
      steepest = std::max(steepest, (v.col(i) - v.col(i - 1)).norm() / step);
    }
  }
  return steepest > 0.0 ? std::sqrt(2.0 * kPart * sigma / steepest)
                        : std::numeric_limits<double>::infinity();
}

}  // namespace

double TypicalSigma(const Observations& o) {
  double information = 0.0;
  for (const MarkSeries& m : o.marks) {
    for (const Eigen::Index row : {0, 3, 5}) information += m.cov.row(row).cwiseInverse().sum();
  }
  return information > 0.0 ? std::sqrt(3.0 * static_cast<double>(o.size()) / information) : 0.0;
}

double RmsDifference(const Prediction& a, const Prediction& b) {
  double sum = 0.0, n = 0.0;
  for (std::size_t m = 0; m < a.marks.size(); ++m) {
    sum += (a.marks[m].p - b.marks[m].p).squaredNorm();
    n += static_cast<double>(a.marks[m].p.cols());
  }
  return n > 0.0 ? std::sqrt(sum / n) : 0.0;
}

double RmsInSigmas(const Observations& o, const Clock& reference, const Prediction& a,
                   const Prediction& b) {
  const double sigma = TypicalSigma(o);
  double largest = sigma > 0.0 ? RmsDifference(a, b) / sigma : 0.0;
  const Change change = Difference(o, a, b);
  const ResidualKind::Clocks clocks = ClocksOf(o, reference, reference);
  for (std::size_t k = 0; k < o.others.size(); ++k) {
    if (o.others[k]->series().empty()) continue;  // events: a latch that moved is no scatter
    const Eigen::VectorXd rows = o.others[k]->Response(change.others[k], clocks, {});
    largest = std::max(largest, rows.norm() / std::sqrt(static_cast<double>(rows.size())));
  }
  return largest;
}

ReducedProblem::ReducedProblem(std::vector<Part> parts, const RegistrationOptions& options,
                               Evaluator& evaluator)
    : parts_(std::move(parts)), options_(options), evaluator_(evaluator) {
  options_.with_others = true;
  for (const Part& part : parts_) {
    first_.push_back(rows_);
    rows_ += RowLayout(*part.observations).rows;
  }
  first_.push_back(rows_);
  for (const Parameter& p : parameters()) {
    rows_ += p.has_prior ? 1 : 0;
    steps_.push_back(kFirstStep * SizeOf(p));
  }
}

std::vector<Evaluator::Request> ReducedProblem::RequestsAt(const std::vector<double>& u,
                                                           const std::string& purpose) const {
  std::vector<Evaluator::Request> out;
  const std::vector<double> theta = Values(parameters(), u.data());
  for (const Part& part : parts_) out.push_back({part.trial, theta, purpose});
  return out;
}

bool ReducedProblem::Finish(const std::vector<double>& u,
                            std::span<const Evaluator::Answer> answers, Point* point) {
  const bool good = CostOf(u, answers, point);
  if (!point->registration.empty()) {
    evaluator_.NoteCost(Values(parameters(), u.data()), point->cost);
  }
  return good;
}

bool ReducedProblem::CostOf(const std::vector<double>& u,
                            std::span<const Evaluator::Answer> answers, Point* point) const {
  const std::vector<double> theta = Values(parameters(), u.data());
  point->prediction.assign(answers.begin(), answers.end());
  point->registration.clear();
  for (const Evaluator::Answer& answer : answers) {
    if (answer->status != ModelStatus::kGood) {
      point->failure = answer->message;
      return false;
    }
  }
  point->residual.setZero(rows_);
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Part& part = parts_[i];
    point->registration.push_back(FitRegistration(*part.observations, *answers[i], part.reference,
                                                  part.start, options_, part.whitening));
    const Eigen::VectorXd& r = point->registration.back().residual;
    point->residual.segment(first_[i], r.size()) = r;
  }
  Eigen::Index row = first_prior_row();
  for (std::size_t j = 0; j < parameters().size(); ++j) {
    const Parameter& p = parameters()[j];
    if (p.has_prior) point->residual(row++) = (theta[j] - p.prior_mean) / p.prior_sigma;
  }
  point->cost = 0.5 * point->residual.squaredNorm();
  if (!std::isfinite(point->cost)) {
    point->failure = "the residuals are not finite";
    return false;
  }
  return true;
}

bool ReducedProblem::ClocksHold(const Point& point, const std::vector<Registration>& at,
                                double misfit) const {
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Part& part = parts_[i];
    const Observations& o = *part.observations;
    // Without sigmas the weights are 1 m^-1, and the residuals are what tells of errors.
    const double sigma = TypicalSigma(o) * (o.has_sigma ? 1.0 : std::sqrt(misfit));
    double carried = CarriedFor(*point.prediction[i], sigma, o.StampsAt(part.reference));
    for (const auto& kind : o.others) carried = std::min(carried, kind->Carries());
    for (double stamp : {o.Start(), o.End()}) {  // a drift moves the ends most
      const double ahead = Ahead(stamp, o.Pivot(), part.reference, at[i].clock());
      if (std::abs(ahead) > carried) return false;
    }
  }
  return true;
}

bool ReducedProblem::At(const std::vector<double>& u, Point* point, const std::string& purpose) {
  if (!Finish(u, evaluator_.Evaluate(RequestsAt(u, purpose)), point)) return false;
  TakeStarts(*point);  // nearer than the first for every later point
  return true;
}

std::vector<bool> ReducedProblem::AtAll(const std::vector<std::vector<double>>& u,
                                        std::vector<Point>* points, const std::string& purpose) {
  std::vector<Evaluator::Request> requests;
  for (const std::vector<double>& one : u) {
    for (Evaluator::Request& r : RequestsAt(one, purpose)) requests.push_back(std::move(r));
  }
  const std::vector<Evaluator::Answer> answers = evaluator_.Evaluate(requests);
  points->resize(u.size());
  std::vector<bool> good(u.size());
  for (std::size_t i = 0; i < u.size(); ++i) {
    good[i] =
        Finish(u[i], std::span(answers).subspan(i * parts_.size(), parts_.size()), &(*points)[i]);
  }
  return good;
}

bool ReducedProblem::Shifted(const std::vector<double>& u, std::size_t j, int side,
                             std::vector<double>* moved) const {
  *moved = u;
  const Parameter& p = parameters()[j];
  const double step = side * steps_[j] / Slope(p, FromInternal(p, u[j]));
  (*moved)[j] = StepByValue(p, u[j], step);
  return std::abs(ValueStep(p, u[j], (*moved)[j]) - step) < 1e-3 * std::abs(step);
}

bool ReducedProblem::CentralSensitivity(const std::vector<double>& u, const Point& at,
                                        Eigen::MatrixXd* J, std::vector<double>* kinks,
                                        const std::vector<Evaluator::Request>& beside,
                                        Changes* change) {
  std::vector<Evaluator::Request> forward(beside);
  for (std::size_t j = 0; j < u.size(); ++j) {
    std::vector<double> moved;
    if (!Shifted(u, j, +1, &moved)) continue;
    for (Evaluator::Request& r : RequestsAt(moved, "difference")) forward.push_back(std::move(r));
  }
  Eigen::MatrixXd minus, plus;
  Changes backward, ahead;
  if (!Sensitivity(u, at, -1, &minus, &backward, forward) ||
      !Sensitivity(u, at, +1, &plus, &ahead)) {
    return false;
  }
  *J = 0.5 * (minus + plus);
  auto take = [&](std::size_t j, bool both, bool forward_side) {
    for (std::size_t i = 0; change != nullptr && i < parts_.size(); ++i) {
      (*change)[i].push_back(both ? Scaled(Sum(backward[i][j], 1.0, ahead[i][j]), 0.5)
                                  : (forward_side ? ahead : backward)[i][j]);
    }
  };
  if (change != nullptr) change->assign(parts_.size(), {});
  const Eigen::MatrixXd down = Project(at, minus), up = Project(at, plus);
  if (kinks != nullptr) kinks->assign(u.size(), 0.0);
  for (Eigen::Index j = 0; j < J->cols(); ++j) {
    const double sum = (up.col(j) + down.col(j)).norm();
    const double kink = sum > 0.0 ? (up.col(j) - down.col(j)).norm() / sum : 0.0;
    if (kinks != nullptr) (*kinks)[static_cast<std::size_t>(j)] = kink;
    if (kink <= kKink) {
      take(static_cast<std::size_t>(j), true, false);
      continue;
    }
    const double rise = up.col(j).dot(at.residual), fall = -down.col(j).dot(at.residual);
    bool forward_side;
    if (rise < 0.0 && fall < 0.0) {
      forward_side = rise / up.col(j).norm() < fall / down.col(j).norm();
    } else if (rise < 0.0 || fall < 0.0) {
      forward_side = rise < 0.0;
    } else {
      forward_side = up.col(j).norm() > down.col(j).norm();
    }
    J->col(j) = forward_side ? plus.col(j) : minus.col(j);
    take(static_cast<std::size_t>(j), false, forward_side);
  }
  return true;
}

bool ReducedProblem::Sensitivity(const std::vector<double>& u, const Point& at, int sign,
                                 Eigen::MatrixXd* J, Changes* change_out,
                                 const std::vector<Evaluator::Request>& beside) {
  const std::size_t p = parameters().size(), parts = parts_.size();
  std::vector<Evaluator::Request> requests(beside);  // first: they may be the long ones
  std::vector<std::vector<double>> points(p);
  for (std::size_t j = 0; j < p; ++j) {
    if (!Shifted(u, j, sign, &points[j])) Shifted(u, j, -sign, &points[j]);
    for (Evaluator::Request& r : RequestsAt(points[j], "difference")) {
      requests.push_back(std::move(r));
    }
  }
  std::vector<Evaluator::Answer> answers = evaluator_.Evaluate(requests);
  answers.erase(answers.begin(), answers.begin() + static_cast<std::ptrdiff_t>(beside.size()));
  auto good = [&](std::size_t j) {
    for (std::size_t i = 0; i < parts; ++i) {
      if (answers[j * parts + i]->status != ModelStatus::kGood) return false;
    }
    return true;
  };
  Changes change(parts);
  for (std::size_t j = 0; j < p; ++j) {
    if (!good(j)) {  // a recorded failure: try the other side
      const int side = points[j][j] > u[j] ? -1 : +1;
      if (!Shifted(u, j, side, &points[j])) return false;
      const auto other = evaluator_.Evaluate(RequestsAt(points[j], "difference"));
      std::copy(other.begin(), other.end(),
                answers.begin() + static_cast<std::ptrdiff_t>(j * parts));
      if (!good(j)) return false;
    }
    const double h = ValueStep(parameters()[j], u[j], points[j][j]);
    for (std::size_t i = 0; i < parts; ++i) {
      const Prediction& moved = *answers[j * parts + i];
      change[i].push_back(Difference(*parts_[i].observations, *at.prediction[i], moved, 1.0 / h));
    }
  }
  *J = RowsOf(u, at, change);
  if (change_out != nullptr) *change_out = std::move(change);
  return true;
}

Eigen::MatrixXd ReducedProblem::RowsOf(const std::vector<double>& u, const Point& at,
                                       const Changes& change) const {
  const std::size_t p = parameters().size();
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(rows_, static_cast<Eigen::Index>(p));
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    Eigen::MatrixXd data =
        WhitenedSensitivity(*parts_[i].observations, *at.prediction[i], parts_[i].reference,
                            at.registration[i].at, change[i]);
    if (parts_[i].whitening != nullptr) parts_[i].whitening->Apply(data);
    J.middleRows(first_[i], data.rows()) = data;
  }
  Eigen::Index row = first_prior_row();
  for (std::size_t j = 0; j < p; ++j) {
    const Parameter& q = parameters()[j];
    if (!q.has_prior) continue;
    J(row++, static_cast<Eigen::Index>(j)) = Slope(q, FromInternal(q, u[j])) / q.prior_sigma;
  }
  return J;
}

Eigen::MatrixXd ReducedProblem::Project(const Point& at, const Eigen::MatrixXd& J) const {
  Eigen::MatrixXd out = J;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Eigen::MatrixXd& N = at.registration[i].jacobian;
    if (N.cols() == 0) continue;
    const auto rows = J.middleRows(first_[i], N.rows());
    // Unit columns first: rotations, metres and seconds share one normal matrix.
    const Eigen::VectorXd scale = N.colwise().norm().cwiseMax(1e-300).cwiseInverse();
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(N.cols(), N.cols());
    normal.selfadjointView<Eigen::Lower>().rankUpdate(N.transpose());
    normal.triangularView<Eigen::StrictlyUpper>() = normal.transpose();
    normal = scale.asDiagonal() * normal * scale.asDiagonal();
    const Eigen::MatrixXd right = scale.asDiagonal() * (N.transpose() * rows);
    const Eigen::MatrixXd coefficients = normal.completeOrthogonalDecomposition().solve(right);
    out.middleRows(first_[i], N.rows()).noalias() -= N * (scale.asDiagonal() * coefficients);
  }
  return out;
}

void ReducedProblem::SetSteps(const std::vector<double>& u, const Eigen::MatrixXd& J,
                              const Point& at, double target) {
  double n = 0.0;
  for (const RegistrationFit& r : at.registration) n += static_cast<double>(r.data_rows);
  n = std::max(1.0, n);
  for (std::size_t j = 0; j < parameters().size(); ++j) {
    const Parameter& p = parameters()[j];
    const double value = FromInternal(p, u[j]);
    const double rms =
        J.col(static_cast<Eigen::Index>(j)).norm() / std::sqrt(n) / std::abs(Slope(p, value));
    // Of a logarithm that has fallen far below its start a twentieth may be nothing to the data.
    const double size = p.log ? std::max(SizeOf(p), value) : SizeOf(p);
    const double widest = kWidestStep * size;
    steps_[j] = rms > 0.0 ? std::clamp(target / rms, kNarrowest * size, widest) : widest;
  }
}

}  // namespace unfurl::correlate
