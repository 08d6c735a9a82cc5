#include "correlate/fit/fit_covariance.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "correlate/fit/constancy.h"
#include "correlate/fit/fit_stated.h"
#include "correlate/fit/noise_doubt.h"
#include "correlate/fit/normal_matrix.h"
#include "correlate/fit/quantised.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

namespace {

// The model's error as independent directions: one for each mark and section of time.
Eigen::MatrixXd SectionShifts(const Observations& o, const RowWhitening* whitening,
                              const Eigen::MatrixXd& gain, const Eigen::VectorXd& error,
                              int sections) {
  const double start = o.Start(), span = std::max(1e-12, o.End() - start);
  const RowLayout layout(o);
  const auto count = static_cast<Eigen::Index>(layout.series.size());
  auto section = [&](double t) {
    return std::clamp(static_cast<int>((t - start) / span * sections), 0, sections - 1);
  };
  Eigen::MatrixXd pieces =
      Eigen::MatrixXd::Zero(error.size(), std::max<Eigen::Index>(count, 1) * sections);
  std::vector<std::uint8_t> placed(static_cast<std::size_t>(error.size()), 0);
  for (Eigen::Index m = 0; m < count; ++m) {
    const RowSeries& series = layout.series[static_cast<std::size_t>(m)];
    for (std::size_t i = 0; i < series.size(); ++i) {
      const Eigen::Index row = series.Row(i), column = m * sections + section((*series.t)[i]);
      pieces.col(column).segment(row, series.axes) = error.segment(row, series.axes);
      std::fill_n(placed.begin() + row, series.axes, 1);
    }
  }
  // Events and the like move with the sections that they lie in.
  for (std::size_t k = 0; k < o.others.size(); ++k) {
    for (Eigen::Index i = 0; i < o.others[k]->rows(); ++i) {
      const Eigen::Index row = layout.others[k] + i;
      const double t = o.others[k]->TimeOf(i);
      if (placed[static_cast<std::size_t>(row)] || std::isnan(t)) continue;
      for (Eigen::Index m = 0; m < std::max<Eigen::Index>(count, 1); ++m) {
        pieces(row, m * sections + section(t)) =
            error(row) / std::sqrt(std::max<double>(1.0, static_cast<double>(count)));
      }
    }
  }
  if (whitening != nullptr) whitening->Apply(pieces);
  return gain * pieces;
}

// What an error of the model does to the unknowns: as a whole, and in independent pieces.
struct ErrorShift {
  Eigen::MatrixXd rows;    // of the trial, in the samples' own sigmas; one column
  Eigen::VectorXd common;  // of the unknowns
  Eigen::MatrixXd pieces;  // unknowns x sections

  ErrorShift(const Observations& o, const TrialResult& trial, const RowWhitening* whitening,
             const Eigen::MatrixXd& gain, int sections, const Change& error)
      : rows(WhitenedSensitivity(o, trial.prediction, trial.reference, trial.at, {error})) {
    pieces = SectionShifts(o, whitening, gain, rows.col(0), sections);
    Eigen::MatrixXd whitened = rows;
    if (whitening != nullptr) whitening->Apply(whitened);
    common = gain * whitened;
  }
};

double RmsOfTracks(const std::vector<Eigen::Matrix3Xd>& tracks) {
  double sum = 0.0, n = 0.0;
  for (const auto& t : tracks) sum += t.squaredNorm(), n += static_cast<double>(t.cols());
  return n > 0.0 ? std::sqrt(sum / n) : 0.0;
}

// Rows before whitening in time, at the same place.
RegistrationFit PlainRows(const Observations& o, const TrialResult& trial,
                          const RegistrationOptions& options) {
  RegistrationOptions stay = options;
  stay.max_iterations = 0;
  stay.with_others = true;
  return FitRegistration(o, trial.prediction, trial.reference, trial.at, stay);
}

// Readings of coarse instruments, by all unknowns of the trial.
QuantisedRows CoarseRows(const Observations& o, const TrialResult& trial, const StackedRows& plain,
                         const StackedRows::Block& b) {
  const auto p = static_cast<Eigen::Index>(trial.change.size());
  return {o, trial.residual, plain.A.block(b.row, 0, b.rows, p),
          plain.A.block(b.row, b.column, b.rows, b.columns)};
}

void FillBand(const Eigen::MatrixXd& covariance, TrialResult* trial) {
  const std::size_t p = trial->change.size();
  trial->band.clear();
  for (std::size_t m = 0; p > 0 && m < trial->change[0].marks.size(); ++m) {
    const Eigen::Index n = trial->change[0].marks[m].cols();
    Eigen::Matrix3Xd variance = Eigen::Matrix3Xd::Zero(3, n);
    for (std::size_t j = 0; j < p; ++j) {
      for (std::size_t l = 0; l < p; ++l) {
        variance.array() += covariance(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(l)) *
                            trial->change[j].marks[m].array() * trial->change[l].marks[m].array();
      }
    }
    trial->band.push_back(variance.cwiseMax(0.0).cwiseSqrt());
  }
}

// The model's part of the covariance: of the error found, and of the doubt about it where there are
// two estimates.
struct ModelPart {
  Eigen::MatrixXd covariance, doubtful;  // of the unknowns; the part to either side
  Eigen::VectorXd common;                // shift of the unknowns that the error as a whole causes
  Eigen::VectorXd rows;                  // the error in the samples' own sigmas, all trials
};

struct ModelPartInput {
  const FitProblem& problem;
  const std::vector<const Observations*>& data;
  const std::vector<const RowWhitening*>& whitening;
  const StackedRows& whole;
  const Eigen::MatrixXd& inverse;
  int sections;
  const WaysOfError& ways;
};

// Adds a trial's error, or the doubt about it, to the covariance; its shift as a whole.
struct Shifts {
  Eigen::MatrixXd covariance;
  Eigen::VectorXd common;
  explicit Shifts(Eigen::Index n)
      : covariance(Eigen::MatrixXd::Zero(n, n)), common(Eigen::VectorXd::Zero(n)) {}
  void Add(const ErrorShift& one) {
    covariance += one.pieces * one.pieces.transpose();
    common += one.common;
  }
  void AddCommon() { covariance += common * common.transpose(); }
};

ModelPart PartOfModel(const ModelPartInput& in, const Eigen::MatrixXd& from_data, FitResult* r) {
  const auto p = static_cast<Eigen::Index>(in.problem.parameters.size());
  const Eigen::Index n = in.inverse.rows();
  Shifts error(n), doubt(n), scatter(n);
  ModelPart out;
  out.rows = Eigen::VectorXd::Zero(in.whole.A.rows());
  const Eigen::MatrixXd gain = in.inverse * in.whole.A.transpose();
  bool second = r->ladder.used;
  for (std::size_t t = 0; t < r->trials.size(); ++t) {
    TrialResult& trial = r->trials[t];
    const StackedRows::Block& b = in.whole.blocks[t];
    second = second && !trial.model_doubt.empty();
    if (trial.model_error.empty()) continue;
    const Observations& o = *in.data[t];
    const Eigen::MatrixXd own = gain.middleCols(b.row, b.rows);
    auto shift = [&](const Change& change) {
      return ErrorShift(o, trial, in.whitening[t], own, in.sections, change);
    };
    const ErrorShift found = shift(trial.model_error);
    error.Add(found);
    out.rows.segment(b.row, b.rows) = found.rows.col(0);
    trial.model_error_rms = RmsOfTracks(trial.model_error.marks);
    trial.model_error_sigmas =
        std::sqrt(found.rows.squaredNorm() /
                  std::max(1.0, static_cast<double>(trial.registration.data_rows)));
    if (!trial.model_doubt.empty()) doubt.Add(shift(trial.model_doubt));
    if (!trial.model_scatter.empty()) scatter.Add(shift(trial.model_scatter));
  }
  if (in.ways.first.size() == p) error.common.head(p) = -in.ways.first;
  if (in.ways.second.size() == p) doubt.common.head(p) = in.ways.second - in.ways.first;
  for (Shifts* part : {&error, &doubt, &scatter}) part->AddCommon();
  out.common = error.common;
  out.doubtful = doubt.covariance + scatter.covariance;
  if (in.ways.bend.size() == p) {
    out.doubtful.topLeftCorner(p, p) += in.ways.bend * in.ways.bend.transpose();
  }
  // Estimates that differ by less than they are large know the error's direction: the value without
  // it lies between none and all of it (variance of a uniform density about its end: a third), give
  // or take the doubt. Else the error found is a bound to either side.
  const Eigen::VectorXd scale = from_data.diagonal().head(p).cwiseMax(1e-300).cwiseSqrt();
  auto size = [&](const Eigen::VectorXd& v) { return v.head(p).cwiseQuotient(scale).norm(); };
  r->ladder.one_sided = second && size(doubt.common) < size(error.common);
  if (r->ladder.one_sided) {
    out.covariance = error.common * error.common.transpose() / 3.0 + out.doubtful;
  } else {
    out.covariance = error.covariance + out.doubtful;
    out.doubtful = out.covariance;
  }
  return out;
}

// Over all trials whose noise has a memory.
Eigen::MatrixXd DoubtOfNoises(const std::vector<const Observations*>& data,
                              const std::vector<const RowWhitening*>& whitening,
                              const StackedRows& plain, const Eigen::MatrixXd& H,
                              const Eigen::MatrixXd& inverse, const FitResult& r) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(H.rows(), H.cols());
  for (std::size_t t = 0; t < data.size(); ++t) {
    if (whitening[t] == nullptr || whitening[t]->identity()) continue;
    NoiseDoubtInput in{data[t], &r.trials[t].noise, &r.trials[t].residual, {}, {}, &H, &inverse};
    in.TakeRows(plain, t, static_cast<Eigen::Index>(r.parameters.size()));
    out += DoubtOfNoise(in);
  }
  return out;
}

}  // namespace

void FillCovariance(const FitProblem& problem, const std::vector<const Observations*>& data,
                    const std::vector<const RowWhitening*>& whitening, const FitOptions& options,
                    FitResult* r, Eigen::MatrixXd* doubt, const WaysOfError& ways) {
  const auto p = static_cast<Eigen::Index>(problem.parameters.size());
  const std::size_t trials = problem.trials.size();
  std::vector<Eigen::MatrixXd> jacobian, plain_jacobian;
  Eigen::MatrixXd plain_sensitivity = r->sensitivity;  // the priors' rows are the same
  for (std::size_t t = 0; t < trials; ++t) {
    TrialResult& trial = r->trials[t];
    jacobian.push_back(trial.registration.jacobian);
    const RegistrationFit plain = PlainRows(*data[t], trial, options.align.registration);
    plain_jacobian.push_back(plain.jacobian);
    trial.residual = plain.residual;
  }
  const StackedRows whole = StackRows(r->sensitivity, jacobian);
  for (std::size_t t = 0; t < trials; ++t) {
    const TrialResult& trial = r->trials[t];
    const StackedRows::Block& b = whole.blocks[t];
    plain_sensitivity.middleRows(b.row, b.rows) =
        WhitenedSensitivity(*data[t], trial.prediction, trial.reference, trial.at, trial.change);
  }
  const Eigen::MatrixXd H = Gram(whole.A);
  Eigen::MatrixXd open, open_white;
  const Eigen::MatrixXd inverse = InverseOfNormal(H, &open);
  const StackedRows plain = StackRows(plain_sensitivity, plain_jacobian);
  const Eigen::MatrixXd inverse_white = InverseOfNormal(Gram(plain.A), &open_white);
  const Eigen::MatrixXd white = inverse_white + open_white;

  // The middle: rows of the samples with what correlation they still have, priors, draws.
  const Eigen::MatrixXd priors = whole.A.bottomRows(whole.A.rows() - whole.first_prior);
  Eigen::MatrixXd middle = priors.transpose() * priors;
  std::vector<double> dof(trials, 1.0);
  std::vector<QuantisedRows> coarse;
  for (std::size_t t = 0; t < trials; ++t) {
    TrialResult& trial = r->trials[t];
    const StackedRows::Block& b = whole.blocks[t];
    const Observations& o = *data[t];
    trial.plain = EstimateResidualNoise(o, trial.residual);
    trial.whitened = EstimateResidualNoise(o, trial.registration.residual);
    // Events, priors and what is known of clock and frame: independent rows of unit variance.
    const RowLayout layout(o);
    dof[t] =
        std::max<double>(1.0, static_cast<double>(trial.registration.data_rows - p - b.columns +
                                                  o.shared_rank + layout.IndependentRows()));
    trial.chi2_per_dof = trial.residual.squaredNorm() / dof[t];
    trial.data_sigma = TypicalSigma(o);
    ResidualNoise noise = trial.whitened;
    if (trial.noise.below) {  // what follows itself there is no noise
      for (ResidualNoise::Series& series : noise.series) series.model.a.clear();
    }
    coarse.push_back(CoarseRows(o, trial, plain, b));
    if (coarse[t].any()) {
      std::erase_if(noise.series,
                    [&](const ResidualNoise::Series& s) { return coarse[t].Holds(s.row.front()); });
      middle += coarse[t].Middle(whole.A.middleRows(b.row, b.rows), whitening[t]);
    }
    middle += noise.Middle(whole.A.middleRows(b.row, b.rows));
    const Eigen::Index k = o.shared_rank;
    const auto draw = whole.A.middleRows(b.row + b.rows - k, k);
    middle += draw.transpose() * draw;
    trial.calibration_shift = inverse.topRows(p) * draw.transpose();
    middle += layout.IndependentGram(whole.A.middleRows(b.row, b.rows));
    for (std::size_t s = 0; s < t; ++s) {
      const StackedRows::Block& other = whole.blocks[s];
      const bool common = !problem.trials[t].calibration.empty() &&
                          problem.trials[t].calibration == problem.trials[s].calibration &&
                          data[s]->shared_rank == o.shared_rank;
      if (!common || k == 0) continue;
      // One draw for both: their prior rows are fully correlated.
      const Eigen::MatrixXd cross =
          draw.transpose() * whole.A.middleRows(other.row + other.rows - k, k);
      middle += cross + cross.transpose();
    }
  }
  Eigen::MatrixXd from_data = inverse * middle * inverse + open;
  if (doubt->size() == 0) *doubt = DoubtOfNoises(data, whitening, plain, H, inverse, *r);
  from_data += *doubt;

  Eigen::VectorXd left = Eigen::VectorXd::Zero(plain.A.rows());
  for (std::size_t t = 0; t < trials; ++t) {
    left.segment(whole.blocks[t].row, whole.blocks[t].rows) = r->trials[t].residual;
  }
  const int sections = std::max(1, options.error_sections);
  ModelPart model =
      PartOfModel({problem, data, whitening, whole, inverse, sections, ways}, from_data, r);
  Eigen::VectorXd& finer = model.rows;
  for (Eigen::VectorXd* rows : {&left, &finer}) {
    *rows -= plain.A * (inverse_white * (plain.A.transpose() * *rows));
  }
  const Eigen::MatrixXd total = from_data + model.covariance;
  // Infinite is what nothing tells of.
  if (total.diagonal().array().isNaN().any()) {
    throw std::logic_error("the covariance of a fit is not a number");
  }
  r->stated = StatedOf(problem, data, options, plain, inverse_white, model.covariance, *r);
  for (std::size_t t = 0; t < trials; ++t) {
    TrialResult& trial = r->trials[t];
    const StackedRows::Block& b = whole.blocks[t];
    Eigen::VectorXd residual = trial.residual;
    const Eigen::Index left_out =
        LeaveOutContradicted(r->stated, t, b.row, &residual, &plain_jacobian[t]);
    GoodnessInput in;
    in.observations = data[t];
    in.plain = &trial.plain;
    in.whitened = &trial.whitened;
    in.whitened_residual = &trial.registration.residual;
    in.residual = &residual;
    in.squares = residual.squaredNorm();
    in.dof = std::max(1.0, dof[t] - static_cast<double>(left_out));
    trial.chi2_per_dof = in.squares / in.dof;
    if (trial.error_check == ErrorCheck::kFiner || trial.error_check == ErrorCheck::kLadder) {
      const auto here = left.segment(b.row, b.rows), change = finer.segment(b.row, b.rows);
      in.left = here.squaredNorm();
      in.finer = change.squaredNorm();
      in.left_by_finer = here.dot(change);
    }
    in.below = trial.noise.below;
    in.sections = sections;
    ConstancyInput same;
    same.observations = data[t];
    same.prediction = &trial.prediction;
    same.reference = trial.reference;
    same.at = trial.at;
    same.registration = options.align.registration;
    same.residual = &residual;
    same.jacobian = &plain_jacobian[t];
    same.sensitivity = plain_sensitivity.middleRows(b.row, b.rows);
    same.known = trial.model_error;
    same.rivals = &trial.rivals;
    same.quantised = in.quantised = &coarse[t];
    in.whitening = whitening[t];
    in.constancy = &same;
    trial.goodness = TestGoodness(in);
  }

  r->covariance = total.topLeftCorner(p, p);
  r->covariance_model = model.covariance.topLeftCorner(p, p);
  const Eigen::VectorXd sigma = total.diagonal().cwiseMax(0.0).cwiseSqrt();
  const Eigen::VectorXd unit = sigma.cwiseMax(1e-300).cwiseInverse();
  r->correlation = unit.head(p).asDiagonal() * r->covariance * unit.head(p).asDiagonal();
  for (std::size_t t = 0; t < trials; ++t) {
    const StackedRows::Block& b = whole.blocks[t];
    TrialResult& trial = r->trials[t];
    RegistrationOptions all = WithPlacement(options.align.registration, *data[t]);
    all.with_others = true;
    trial.nuisances = Nuisances(all, *data[t]);
    trial.nuisance_sigma = sigma.segment(b.column, b.columns);
    FillBand(r->covariance, &trial);
  }
  for (Eigen::Index j = 0; j < p; ++j) {
    ParameterEstimate& e = r->parameters[static_cast<std::size_t>(j)];
    e.sigma = sigma(j);
    e.sigma_data = std::sqrt(std::max(from_data(j, j), 0.0));
    e.sigma_white = std::sqrt(std::max(white(j, j), 0.0));
    e.sigma_model = std::sqrt(std::max(model.covariance(j, j), 0.0));
    e.sigma_doubt = std::sqrt(std::max(model.doubtful(j, j), 0.0));
    e.model_shift = -model.common(j);
  }
}

}  // namespace unfurl::correlate
