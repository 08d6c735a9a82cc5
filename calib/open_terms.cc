#include "calib/open_terms.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "calib/covariance.h"
#include "calib/parameters.h"
#include "calib/score_test.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

constexpr double kFeltRise = 0.02;  // of squared errors: error bars 1% short, which nobody sees [-]
constexpr double kLeastScale = 1e-7;  // of the priors: 1e-5 px of a row of 16384 [-]
constexpr int kScaleSteps = 70;       // from there to 1, a third apart: a posterior is wider [-]
constexpr int kScaleHalvings = 40;  // of the range of log tau^2: to the last digit that matters [-]
constexpr int kScaleSweeps = 6;     // over the cameras, whose terms hang together but weakly [-]
constexpr int kOpenRounds = 4;      // of fits: floors fall once terms take their place [-]
constexpr double kScaleSettled = 0.2;  // change of a scale that no longer matters [-]

// The score of the terms, in units of their priors, and its covariance under no terms: the data
// alone say z ~ N(M^-1 s, M^-1).
struct Evidence {
  Eigen::VectorXd score;        // s
  Eigen::MatrixXd information;  // M
};

// One camera's terms, given those of the others: eigenvalues of their information, the score along
// the eigenvectors.
struct OneCamera {
  Eigen::VectorXd lambda, score;
  std::vector<Eigen::Index> at;  // of all open terms

  // How many of the terms the data tell where their variance is t [-].
  double Told(double t) const {
    double sum = 0.0;
    for (const double l : lambda) sum += t * l / (1.0 + t * l);
    return sum;
  }
  double LogDensity(double t) const {
    double sum = 0.0;
    for (Eigen::Index i = 0; i < lambda.size(); ++i) {
      const double gain = 1.0 + t * lambda(i);
      sum += 0.5 * (t * score(i) * score(i) / gain - std::log(gain));
    }
    return sum;
  }
  // The variance that tells so many terms.
  double SquareThatTells(double told) const {
    double low = 2.0 * std::log(kLeastScale), high = 0.0;  // of its logarithm
    for (int k = 0; k < kScaleHalvings; ++k) {
      const double middle = 0.5 * (low + high);
      (Told(std::exp(middle)) < told ? low : high) = middle;
    }
    return std::exp(0.5 * (low + high));
  }
};

// tau on steps of its logarithm.
std::vector<double> ScaleGrid() {
  std::vector<double> out(kScaleSteps);
  for (int k = 0; k < kScaleSteps; ++k) {
    out[static_cast<std::size_t>(k)] =
        std::pow(kLeastScale, 1.0 - k / static_cast<double>(kScaleSteps - 1));
  }
  return out;
}

// Posterior probabilities of the grid for a density of the data, with a uniform prior of tau from 0
// to 1; `log_evidence` of that prior [nat].
std::vector<double> PosteriorOnGrid(const std::vector<double>& grid, std::vector<double> log_p,
                                    double* log_evidence) {
  const double step = std::log(grid[1] / grid[0]);
  for (std::size_t k = 0; k < grid.size(); ++k) log_p[k] += std::log(grid[k] * step);
  const double most = *std::max_element(log_p.begin(), log_p.end());
  double sum = 0.0;
  for (double& p : log_p) sum += p = std::exp(p - most);
  for (double& p : log_p) p /= sum;
  *log_evidence = most + std::log(sum);
  return log_p;
}

// Of their priors [px].
Eigen::VectorXd SigmasOf(const std::vector<OpenTerm>& open) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(open.size()));
  for (Eigen::Index k = 0; k < out.size(); ++k) out(k) = open[static_cast<std::size_t>(k)].sigma_px;
  return out;
}

// Their coefficients [px].
Eigen::VectorXd ValuesOf(const std::vector<data::RigCamera>& cameras,
                         const std::vector<OpenTerm>& open) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(open.size()));
  for (Eigen::Index k = 0; k < out.size(); ++k) {
    const OpenTerm& term = open[static_cast<std::size_t>(k)];
    out(k) = cameras[static_cast<std::size_t>(term.camera)]
                 .terms_px[static_cast<std::size_t>(term.term)];
  }
  return out;
}

// Of the coefficients z with variances tau^2: their estimate and its covariance.
void PosteriorOf(const Evidence& data, const Eigen::VectorXd& tau, Eigen::VectorXd* mean,
                 Eigen::MatrixXd* covariance) {
  const Eigen::MatrixXd I = Eigen::MatrixXd::Identity(tau.size(), tau.size());
  const Eigen::MatrixXd A = I + tau.asDiagonal() * data.information * tau.asDiagonal();
  *covariance = tau.asDiagonal() * A.llt().solve(I) * tau.asDiagonal();
  *mean = *covariance * data.score;
}

// What the others leave of one camera's terms, at the present tau.
OneCamera CameraGiven(const Evidence& data, const std::vector<OpenTerm>& open, int camera,
                      const Eigen::VectorXd& tau) {
  OneCamera out;
  std::vector<Eigen::Index> others;
  for (std::size_t k = 0; k < open.size(); ++k) {
    (open[k].camera == camera ? out.at : others).push_back(static_cast<Eigen::Index>(k));
  }
  Eigen::VectorXd s = data.score(out.at);
  Eigen::MatrixXd M = data.information(out.at, out.at);
  if (!others.empty() && !out.at.empty()) {
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
    PosteriorOf({data.score(others), data.information(others, others)}, tau(others), &mean,
                &covariance);
    const Eigen::MatrixXd mixed = data.information(out.at, others);
    s -= mixed * mean;
    M -= mixed * covariance * mixed.transpose();
  }
  if (out.at.empty()) return out;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(M);
  out.lambda = eigen.eigenvalues().cwiseMax(0.0);
  out.score = eigen.eigenvectors().transpose() * s;
  return out;
}

// Each camera's tau: that which tells as many terms as all tau do on the average, each weighed by
// its posterior probability; all cameras' alike or each its own, as either is probable.
void FindScales(const Evidence& data, const std::vector<OpenTerm>& open, int cameras,
                Eigen::VectorXd* tau) {
  const std::vector<double> grid = ScaleGrid();
  for (int sweep = 0; sweep < kScaleSweeps; ++sweep) {
    std::vector<OneCamera> each;
    std::vector<std::vector<double>> own;
    std::vector<double> all(grid.size(), 0.0);
    double log_common = 0.0, log_own = 0.0;
    for (int j = 0; j < cameras; ++j) {
      OneCamera one = CameraGiven(data, open, j, *tau);
      if (one.at.empty()) continue;
      std::vector<double> log_p;
      for (std::size_t k = 0; k < grid.size(); ++k) {
        log_p.push_back(one.LogDensity(grid[k] * grid[k]));
        all[k] += log_p.back();
      }
      double evidence = 0.0;
      own.push_back(PosteriorOnGrid(grid, std::move(log_p), &evidence));
      log_own += evidence;
      each.push_back(std::move(one));
    }
    all = PosteriorOnGrid(grid, std::move(all), &log_common);
    const double common = 1.0 / (1.0 + std::exp(log_own - log_common));
    for (std::size_t j = 0; j < each.size(); ++j) {
      double told = 0.0;
      for (std::size_t k = 0; k < grid.size(); ++k) {
        told += (common * all[k] + (1.0 - common) * own[j][k]) * each[j].Told(grid[k] * grid[k]);
      }
      (*tau)(each[j].at).setConstant(std::sqrt(each[j].SquareThatTells(told)));
    }
  }
}

// Of terms that take part with the priors tau: what the data alone say of them.
Evidence OfFit(const std::vector<data::RigCamera>& cameras, const Eigen::MatrixXd& of_cameras,
               const std::vector<OpenTerm>& open, const Eigen::VectorXd& tau) {
  std::vector<Eigen::Index> at;
  at.reserve(open.size());
  for (const OpenTerm& term : open) {
    at.push_back(kParameters * term.camera + data::kFirstTerm + term.term);
  }
  const Eigen::VectorXd sigma = SigmasOf(open).cwiseProduct(tau);
  const Eigen::VectorXd value = ValuesOf(cameras, open).cwiseQuotient(sigma);
  // In units of tau: the prior's information is 1.
  const Eigen::MatrixXd V = of_cameras(at, at).cwiseQuotient(sigma * sigma.transpose());
  const Eigen::MatrixXd I = Eigen::MatrixXd::Identity(tau.size(), tau.size());
  const Eigen::LDLT<Eigen::MatrixXd> root(V);
  const Eigen::VectorXd one = tau.cwiseInverse();
  return {one.asDiagonal() * root.solve(value),
          one.asDiagonal() * (root.solve(I) - I) * one.asDiagonal()};
}

// What a unit of each term does to each reading [px].
Eigen::MatrixXd OnReadings(const Observations& data, const RefinedBundle& bundle,
                           const std::vector<OpenTerm>& open) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(data.readings.size()),
                                              static_cast<Eigen::Index>(open.size()));
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const Reading& r = data.readings[k];
    measure::Projection h;
    if (!bundle.weighting.Uses(k) ||
        !measure::Project(bundle.state.cameras[static_cast<std::size_t>(r.camera)],
                          bundle.state.points.col(r.point), &h)) {
      continue;
    }
    for (std::size_t t = 0; t < open.size(); ++t) {
      if (open[t].camera != r.camera) continue;
      out(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(t)) =
          open[t].sigma_px * h.du_dc(data::kFirstTerm + open[t].term);
    }
  }
  return out;
}

}  // namespace

std::vector<OpenTerm> ListOpenTerms(const std::vector<CameraPrior>& priors,
                                    const std::vector<CameraPrior>& richest) {
  std::vector<OpenTerm> out;
  for (std::size_t j = 0; j < priors.size(); ++j) {
    for (int k = 0; k < kTerms; ++k) {
      if (!priors[j].Fixed(k) || richest[j].Fixed(k)) continue;
      out.push_back(
          {static_cast<int>(j), k, richest[j].term_sigma_px[static_cast<std::size_t>(k)]});
    }
  }
  return out;
}

void FitOpenTerms(const std::vector<OpenTerm>& open, Eigen::VectorXd tau,
                  const std::function<OpenFit(const std::vector<CameraPrior>&)>& fit,
                  std::vector<CameraPrior>* priors) {
  for (int round = 0; round < kOpenRounds; ++round) {
    for (std::size_t k = 0; k < open.size(); ++k) {
      (*priors)[static_cast<std::size_t>(open[k].camera)]
          .term_sigma_px[static_cast<std::size_t>(open[k].term)] =
          open[k].sigma_px * tau(static_cast<Eigen::Index>(k));
    }
    const OpenFit found = fit(*priors);
    Eigen::VectorXd next = tau;
    FindScales(OfFit(*found.cameras, found.covariance, open, tau), open,
               static_cast<int>(priors->size()), &next);
    const double change = (next.cwiseQuotient(tau).array() - 1.0).abs().maxCoeff();
    if (!(change > kScaleSettled)) break;
    tau = std::move(next);
  }
}

OpenTerms TakeOpenTerms(const Observations& data, const std::vector<CameraPrior>& richest,
                        const RefineOptions& options, std::vector<CameraPrior>* priors,
                        RefinedBundle* bundle) {
  OpenTerms out;
  const std::vector<OpenTerm> open = ListOpenTerms(*priors, richest);
  if (open.empty()) return out;
  const Eigen::MatrixXd on_readings = OnReadings(data, *bundle, open);
  Eigen::VectorXd tau = Eigen::VectorXd::Zero(on_readings.cols());
  {
    const ScoreTest test(data, *priors, *bundle);
    const ScoreTest::Score score = test.Of({on_readings, {}});
    const Evidence evidence{score.value, score.covariance};
    FindScales(evidence, open, data.camera_count(), &tau);
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
    PosteriorOf(evidence, tau, &mean, &covariance);
    out.rise =
        test.RiseOfError(on_readings, score.on_cameras, mean * mean.transpose() + covariance);
  }
  if (!(out.rise > kFeltRise)) return out;
  out.taken = true;
  RefineOptions again = options;
  again.choose_gross = false;
  const auto fit = [&](const std::vector<CameraPrior>& now) {
    *bundle = Refine(data, now, bundle->weighting, again, std::move(bundle->state));
    return OpenFit{&bundle->state.cameras, CameraCovariance(bundle->summary.information)};
  };
  FitOpenTerms(open, std::move(tau), fit, priors);
  const Eigen::VectorXd value = ValuesOf(bundle->state.cameras, open).cwiseQuotient(SigmasOf(open));
  out.rms_px = std::sqrt((on_readings * value).squaredNorm() /
                         std::max(1.0, static_cast<double>(data.readings.size())));
  return out;
}

}  // namespace unfurl::calib
