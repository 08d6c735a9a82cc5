#include "correlate/fit_covariance.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace unfurl::correlate {

namespace {

// Inverse of a normal matrix in unit-diagonal form. Directions without information get the large
// but finite variance of the floor, so that what depends on them is seen to be unknown.
Eigen::MatrixXd FlooredInverse(const Eigen::MatrixXd& normal) {
  constexpr double kFloor = 1e-12;
  const Eigen::VectorXd scale = normal.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd unit = scale.asDiagonal() * normal * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(unit);
  const Eigen::VectorXd inverse = eigen.eigenvalues().cwiseMax(kFloor).cwiseInverse();
  const Eigen::MatrixXd V = scale.asDiagonal() * eigen.eigenvectors();
  return V * inverse.asDiagonal() * V.transpose();
}

// The model's error as independent directions: one for each mark and section of time.
Eigen::MatrixXd SectionShifts(const Observations& o, const FitResult& r,
                              const Eigen::MatrixXd& gain, const Eigen::VectorXd& whitened,
                              int sections) {
  const double start = o.Start(), span = std::max(1e-12, o.End() - start);
  const auto marks = static_cast<Eigen::Index>(o.marks.size());
  Eigen::MatrixXd shift = Eigen::MatrixXd::Zero(gain.rows(), marks * sections);
  Eigen::Index row = 0;
  for (Eigen::Index m = 0; m < marks; ++m) {
    const MarkSeries& series = o.marks[static_cast<std::size_t>(m)];
    for (std::size_t i = 0; i < series.size(); ++i, row += 3) {
      const int s =
          std::clamp(static_cast<int>((series.t[i] - start) / span * sections), 0, sections - 1);
      shift.col(m * sections + s) += gain.middleCols<3>(row) * whitened.segment<3>(row);
    }
  }
  (void)r;
  return shift;
}

double Rms(const std::vector<Eigen::Matrix3Xd>& tracks) {
  double sum = 0.0, n = 0.0;
  for (const auto& t : tracks) sum += t.squaredNorm(), n += static_cast<double>(t.cols());
  return n > 0.0 ? std::sqrt(sum / n) : 0.0;
}

}  // namespace

void FillCovariance(const FitProblem& problem, const Observations& o, const FitOptions& options,
                    FitResult* r) {
  const auto p = static_cast<Eigen::Index>(problem.parameters.size());
  const Eigen::MatrixXd& N = r->registration.jacobian;
  const Eigen::Index data = N.rows();
  const Eigen::Index rows = r->sensitivity.rows();
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(rows, p + N.cols());
  A.leftCols(p) = r->sensitivity;
  A.block(0, p, data, N.cols()) = N;
  const Eigen::MatrixXd H = A.transpose() * A;
  const Eigen::MatrixXd inverse = FlooredInverse(H);

  r->noise = EstimateResidualNoise(o, r->registration.residual);
  const double dof = std::max<double>(1.0, 3.0 * static_cast<double>(r->registration.known) -
                                               static_cast<double>(p + N.cols() - o.shared_rank));
  r->chi2_per_dof = r->registration.residual.squaredNorm() / dof;
  const Eigen::Index first_prior = 3 * static_cast<Eigen::Index>(o.size());
  const Eigen::MatrixXd priors = A.bottomRows(rows - first_prior);
  const Eigen::MatrixXd middle = r->noise.Middle(A) + priors.transpose() * priors;
  const Eigen::MatrixXd from_data = inverse * middle * inverse;

  Eigen::MatrixXd from_model = Eigen::MatrixXd::Zero(H.rows(), H.cols());
  Eigen::VectorXd common = Eigen::VectorXd::Zero(H.rows());
  r->data_sigma = TypicalSigma(o);
  if (!r->model_error.empty()) {
    const Eigen::VectorXd whitened =
        WhitenedSensitivity(o, r->prediction, r->registration.at.X_WM, {r->model_error});
    Eigen::VectorXd padded = Eigen::VectorXd::Zero(rows);
    padded.head(whitened.size()) = whitened;
    const Eigen::MatrixXd gain = inverse * A.transpose();
    common = gain * padded;
    const Eigen::MatrixXd sections =
        SectionShifts(o, *r, gain, padded, std::max(1, options.error_sections));
    from_model = common * common.transpose() + sections * sections.transpose();
    r->model_error_rms = Rms(r->model_error);
    r->model_error_sigmas =
        std::sqrt(whitened.squaredNorm() / std::max(1.0, 3.0 * static_cast<double>(o.size())));
  }
  const Eigen::MatrixXd total = from_data + from_model;
  r->covariance = total.topLeftCorner(p, p);
  const Eigen::VectorXd sigma = total.diagonal().cwiseMax(0.0).cwiseSqrt();
  const Eigen::VectorXd unit = sigma.cwiseMax(1e-300).cwiseInverse();
  r->correlation = unit.head(p).asDiagonal() * r->covariance * unit.head(p).asDiagonal();
  r->nuisances = NuisanceNames(options.align.registration, o.shared_rank);
  r->nuisance_sigma = sigma.tail(N.cols());
  for (Eigen::Index j = 0; j < p; ++j) {
    ParameterEstimate& e = r->parameters[static_cast<std::size_t>(j)];
    e.sigma = sigma(j);
    e.sigma_data = std::sqrt(std::max(0.0, from_data(j, j)));
    e.sigma_white = std::sqrt(std::max(0.0, inverse(j, j)));
    e.sigma_model = std::sqrt(std::max(0.0, from_model(j, j)));
    e.model_shift = -common(j);
  }
  // What the data alone say of the parameters, the nuisances projected out.
  const Eigen::MatrixXd information = FlooredInverse(inverse.topLeftCorner(p, p));
  Judge(problem, information, r);
}

void Judge(const FitProblem& problem, const Eigen::MatrixXd& information, FitResult* r) {
  constexpr double kHalf = 0.5;  // of the value: beyond, "not determined"
  constexpr double kAtBoundSigmas = 1e-3;
  constexpr double kSurePart = 1e-5;   // share of information below which a combination is open,
  constexpr double kRoughPart = 1e-2;  // and where rough differences make the share uncertain
  const auto p = static_cast<Eigen::Index>(r->parameters.size());

  // Parameters that only a combination of which is determined: a small eigenvalue of the
  // information in unit-diagonal form, judged against the differences' own roughness.
  double roughness = 0.0;
  for (const ParameterEstimate& e : r->parameters) roughness = std::max(roughness, e.kink);
  const double open = std::clamp(roughness * roughness, kSurePart, kRoughPart);
  std::vector<std::vector<std::string>> partners(static_cast<std::size_t>(p));
  if (p > 1) {
    const Eigen::VectorXd scale =
        information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
        Eigen::MatrixXd(scale.asDiagonal() * information * scale.asDiagonal()));
    constexpr double kTakesPart = 0.2;
    for (Eigen::Index v = 0; v < p; ++v) {
      if (eigen.eigenvalues()(v) > open) continue;
      for (Eigen::Index j = 0; j < p; ++j) {
        for (Eigen::Index l = 0; l < p; ++l) {
          if (l != j && std::abs(eigen.eigenvectors()(j, v)) > kTakesPart &&
              std::abs(eigen.eigenvectors()(l, v)) > kTakesPart) {
            partners[static_cast<std::size_t>(j)].push_back(
                problem.parameters[static_cast<std::size_t>(l)].name);
          }
        }
      }
    }
  }

  for (std::size_t j = 0; j < r->parameters.size(); ++j) {
    const Parameter& q = problem.parameters[j];
    ParameterEstimate& e = r->parameters[j];
    const double part =
        e.value != 0.0 ? e.sigma / std::abs(e.value) : std::numeric_limits<double>::infinity();
    const double to_bound = std::min(e.value - q.low, q.high - e.value);
    e.with = partners[j];
    if (to_bound <= kAtBoundSigmas * e.sigma || to_bound <= 1e-9 * std::abs(e.value)) {
      e.verdict = Verdict::kAtBound;
      e.reason = fmt::format(
          "the best value is the bound {:.4g}: the data want to go beyond it, "
          "so its standard error means nothing",
          e.value - q.low < q.high - e.value ? q.low : q.high);
    } else if (!e.with.empty()) {
      e.verdict = Verdict::kCombination;
      e.reason = "the data determine a combination of these, not each by itself";
    } else if (!(part <= kHalf)) {
      e.verdict = Verdict::kNotDetermined;
      e.reason = fmt::format("its standard error is {:.0f}% of its value", 100.0 * part);
    } else if (e.sigma_model > e.sigma_data) {
      e.verdict = Verdict::kMeshLimited;
      e.reason = fmt::format(
          "known to {:.2g}% of its value; the data alone would give {:.2g}%, the model's own error "
          "adds {:.2g}%: a finer model would tell more",
          100.0 * part, 100.0 * e.sigma_data / std::abs(e.value),
          100.0 * e.sigma_model / std::abs(e.value));
    } else {
      e.verdict = Verdict::kDetermined;
      e.reason = fmt::format("known to {:.2g}% of its value", 100.0 * part);
    }
  }
}

const char* Name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kDetermined:
      return "determined";
    case Verdict::kMeshLimited:
      return "limited by the model's own error";
    case Verdict::kCombination:
      return "determined only in combination";
    case Verdict::kAtBound:
      return "at its bound";
    case Verdict::kNotDetermined:
      return "not determined";
  }
  return "";
}

const char* Name(FitStatus status) {
  switch (status) {
    case FitStatus::kConverged:
      return "converged";
    case FitStatus::kNotAligned:
      return "not aligned";
    case FitStatus::kModelFailed:
      return "model failed";
    case FitStatus::kNotConverged:
      return "not converged";
  }
  return "";
}

}  // namespace unfurl::correlate
