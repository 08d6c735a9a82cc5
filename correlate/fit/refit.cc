#include "correlate/fit/refit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "base/error.h"
#include "correlate/fit/correction.h"
#include "correlate/fit/reduced_problem.h"
#include "correlate/fit/refit_path.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

namespace {

// What the fit found of its data: noise of channels, samples that count less or are gross, a clock
// that drifts.
Observations AsLeft(const Observations& plain, const TrialResult& found, double clock_sigma) {
  Observations out = plain;
  if (found.kinds.size() == out.others.size()) out.others = found.kinds;
  const double end = plain.End();
  for (const LessWeight& less : found.less_weight) {
    const int mark = plain.FindMark(less.mark);
    if (mark < 0) continue;
    MarkSeries& series = out.marks[static_cast<std::size_t>(mark)];
    const double more = less.noise * less.noise;  // [m^2]
    for (std::size_t i = 0; i < series.size(); ++i) {
      const bool within = series.t[i] >= less.from && (series.t[i] < less.to || less.to >= end);
      if (!within) continue;
      for (Eigen::Index row : {0, 3, 5}) series.cov(row, static_cast<Eigen::Index>(i)) += more;
    }
  }
  PutAside(found.gross, &out);
  PutAside(found.channel_gross, &out);
  if (found.drift.called) out.placement.drift = Prior::Normal(0.0, clock_sigma);
  return out;
}

std::size_t IndexOf(const FitProblem& problem, const std::string& name) {
  for (std::size_t j = 0; j < problem.parameters.size(); ++j) {
    if (problem.parameters[j].name == name) return j;
  }
  throw Error("it is not in the problem that was fitted", "parameter." + name,
              "refit with the same parameters, or fewer");
}

// As a refit moves it: by its value, as its logarithm has no slope where it is next to nothing and
// has to take over what another did. `value`: where it begins. Its size, by which differences are
// taken, is that of the fit, not that of an estimate of next to nothing.
Parameter Moved(Parameter p, const Parameter& fitted, double value) {
  p.log = false;
  p.start = std::clamp(fitted.start, p.low, p.high);
  if (std::abs(value) > std::abs(p.start)) p.start = value;
  return p;
}

// The stretch of time of every row, by trial; -1: of none.
std::vector<int> StretchesOf(const Observations& o, int first, int stretches) {
  const RowLayout layout(o);
  std::vector<int> out(static_cast<std::size_t>(layout.rows), -1);
  const double start = o.Start(), span = std::max(1e-12, o.End() - start);
  for (const RowSeries& series : layout.series) {
    for (std::size_t i = 0; i < series.size(); ++i) {
      const int k = static_cast<int>(((*series.t)[i] - start) / span * stretches);
      for (Eigen::Index axis = 0; axis < series.axes; ++axis) {
        out[static_cast<std::size_t>(series.Row(i, axis))] =
            first + std::clamp(k, 0, stretches - 1);
      }
    }
  }
  return out;
}

// By how much each of the first `parameters` unknowns moves the plain rows with one standard error
// that the whitened ones give it, all others following; RMS over the data. `scale`: of the squares
// of standard errors.
std::vector<double> MovesOf(const Eigen::MatrixXd& whitened, const Eigen::MatrixXd& plain,
                            Eigen::Index parameters, double scale, double rows) {
  if (parameters == 0) return {};
  // Unit columns first: unknowns of any units share one normal matrix. Those that move nothing
  // stay.
  const Eigen::VectorXd size =
      whitened.colwise().norm().cwiseMax(std::numeric_limits<double>::min()).cwiseInverse();
  const Eigen::MatrixXd unit = whitened * size.asDiagonal();
  const Eigen::MatrixXd covariance =
      (unit.transpose() * unit).completeOrthogonalDecomposition().pseudoInverse();
  std::vector<double> out;
  for (Eigen::Index j = 0; j < parameters; ++j) {
    const double variance = covariance(j, j);
    const Eigen::VectorXd by = size.cwiseProduct(covariance.col(j));
    out.push_back(variance > 0.0 ? std::sqrt(scale / (variance * rows)) * (plain * by).norm()
                                 : 0.0);
  }
  return out;
}

}  // namespace

void RefitOptions::Check() const {
  auto require = [](bool good, const char* option, const char* remedy) {
    if (!good) throw Error("is out of its range", std::string("RefitOptions.") + option, remedy);
  };
  require(runs >= 1, "runs", "allow at least one");
  require(step_tolerance > 0.0 && step_tolerance < 1.0, "step_tolerance", "give a part of 1");
}

Refits::Refits(const FitProblem& problem, const FitResult& fit, const FitOptions& options,
               const FitResult* judge)
    : problem_(problem), options_(options), theta_(fit.Theta()) {
  const FitResult& believed = judge != nullptr ? *judge : fit;
  if (believed.trials.size() != problem.trials.size()) {
    throw Error("another number of trials", "Refits", "let a fit to the same data judge");
  }
  for (std::size_t t = 0; t < problem.trials.size(); ++t) {
    const Observations& o = *problem.trials[t].observations;
    weighed_.push_back(AsLeft(o, believed.trials[t], options.clock_sigma));
    const SeriesNoise& noise = believed.trials[t].noise;
    whitening_.push_back(noise.series.empty() || noise.white()
                             ? RowWhitening()
                             : RowWhitening(weighed_.back(), noise));
    const TrialResult& found = fit.trials[t];
    at_.push_back(found.at);
    change_.push_back(found.change);
    squares_ += found.registration.SumOfSquares();
    const double sigma = TypicalSigma(weighed_[t]);
    if (sigma > 0.0) model_noise_ = std::max(model_noise_, found.model_noise / sigma);
  }
}

void Refits::GoOnFrom(const Refitted& own) {
  if (own.theta.size() != theta_.size() || own.change.size() != change_.size()) {
    throw Error("is no refit of the problem itself", "Refits", "refit it with nothing switched");
  }
  theta_ = own.theta;
  at_ = own.at;
  change_ = own.change;
  squares_ = 0.0;
  for (const Eigen::VectorXd& rows : own.whitened) squares_ += rows.squaredNorm();
}

Refitted Refits::Refit(const FitProblem& asked, const RefitOptions& how) const {
  how.Check();
  FitProblem version = asked;
  if (version.trials.size() != problem_.trials.size()) {
    throw Error("another number of trials", "Refits", "refit versions of the same problem");
  }
  // 1. Values, clocks and sensitivities as the fit ended.
  RefitStart start;
  for (Parameter& p : version.parameters) {
    const std::size_t j = IndexOf(problem_, p.name);
    start.u.push_back(std::clamp(theta_[j], p.low, p.high));
    p = Moved(p, problem_.parameters[j], start.u.back());
  }
  for (std::size_t t = 0; t < version.trials.size(); ++t) {
    start.at.push_back(at_[t]);
    std::vector<Change> changes;
    for (const Parameter& p : version.parameters) {
      changes.push_back(change_[t][IndexOf(problem_, p.name)]);
    }
    start.change.push_back(std::move(changes));
    start.observations.push_back(&weighed_[t]);
    start.whitening.push_back(whitening_[t].identity() ? nullptr : &whitening_[t]);
  }
  start.squares = squares_;
  start.difference = std::max(options_.difference_sigma, options_.noise_factor * model_noise_);

  // 2. Down, looking at the finest rung where the way ends.
  RefitPath path(version, options_, how, std::move(start));
  Refitted out;
  out.status = path.Run();
  out.message = path.message();
  out.looks = path.looks();
  if (out.status == RefitStatus::kFailed || out.status == RefitStatus::kNotAligned) return out;

  // 3. What is there.
  const ReducedProblem::Point& point = path.point();
  out.theta = Values(version.parameters, path.u().data());
  out.prediction = point.prediction;
  out.at = path.at();
  out.change = path.change();
  RegistrationOptions stay = options_.align.registration;
  stay.with_others = true;
  stay.max_iterations = 0;
  const Eigen::MatrixXd J = path.Rows();
  Eigen::Index unknowns = J.cols();
  for (const RegistrationFit& r : point.registration) unknowns += r.jacobian.cols();
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(J.rows(), unknowns);
  A.leftCols(J.cols()) = J;
  Eigen::MatrixXd plain = Eigen::MatrixXd::Zero(J.rows(), unknowns);
  std::vector<int> stretch(static_cast<std::size_t>(J.rows()), -1);
  Eigen::Index column = J.cols();
  for (std::size_t t = 0; t < version.trials.size(); ++t) {
    const RegistrationFit& r = point.registration[t];
    const Eigen::Index first = path.reduced().first_row(t);
    out.whitened.push_back(r.residual);
    out.metres.push_back(ResidualsInModelFrame(weighed_[t], *point.prediction[t],
                                               path.reduced().parts()[t].reference, r.at));
    const Clock& clock = path.reduced().parts()[t].reference;
    RegistrationFit own = FitRegistration(weighed_[t], *point.prediction[t], clock, r.at, stay);
    const Eigen::MatrixXd moved =
        WhitenedSensitivity(weighed_[t], *point.prediction[t], clock, r.at, path.change()[t]);
    out.rows += static_cast<double>(r.data_rows);
    A.block(first, column, r.jacobian.rows(), r.jacobian.cols()) = r.jacobian;
    plain.block(first, 0, moved.rows(), moved.cols()) = moved;
    plain.block(first, column, own.jacobian.rows(), own.jacobian.cols()) = own.jacobian;
    out.residual.push_back(std::move(own.residual));
    column += r.jacobian.cols();
    const std::vector<int> stretches = StretchesOf(
        weighed_[t], static_cast<int>(t) * options_.error_sections, options_.error_sections);
    std::copy(stretches.begin(), stretches.end(), stretch.begin() + first);
  }
  const Eigen::Index priors = path.reduced().first_prior_row();
  out.prior_squares = point.residual.tail(point.residual.size() - priors).squaredNorm();
  out.scatter = path.Scatter();
  out.runs = path.runs();
  const double squares = 2.0 * point.cost;
  if (squares > 0.0) {
    out.least = std::max(0.0, 1.0 - path.LeftToGain() / squares);
  }
  const double rows = std::max(1.0, out.rows), scale = std::max(1.0, squares / rows);
  out.moves = MovesOf(A, plain, J.cols(), scale, rows);
  out.held_out = PredictHeldOut(point.residual, A, stretch, scale);
  return out;
}

}  // namespace unfurl::correlate
