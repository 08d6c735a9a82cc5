#pragma once

#include <Eigen/Core>
#include <vector>

#include "correlate/fit/normal_matrix.h"
#include "correlate/fit/series_noise.h"
#include "correlate/observations.h"

namespace unfurl::correlate {

/// One of the noises that series may have beside the one that was found.
struct LikelyNoise {
  MarkovNoise noise;    ///< its variance the best for its share and correlation
  double weight = 0.0;  ///< probability, those of a group adding up to 1 [-]
};

/// Series that share one noise, and what it may be.
struct NoiseGroup {
  std::vector<std::size_t> series;  ///< in the order of SeriesNoise::series
  std::vector<LikelyNoise> likely;
};

/// What the correlated noises that FitSeriesNoise found may be instead: the restricted likelihood
/// over share (even in its logit) and correlation time (even in its logarithm, from one sample to
/// kLongest lengths of the record), about the estimate. Groups whose noise is white have none.
/// `residual` and `A` as there.
std::vector<NoiseGroup> LikelyNoises(const Observations& observations,
                                     const Eigen::VectorXd& residual, const Eigen::MatrixXd& A,
                                     const SeriesNoise& found);

/// What not knowing the noise adds to the covariance of a generalised least-squares estimate. A
/// record of few correlation times tells its noise badly, and the estimate's covariance by the
/// likeliest one is too small [Kackar and Harville 1984]: averaged over what the noise may be,
///   sum_k w_k (C_k - C + s_k s_k^T),
/// C_k the covariance by noise k and s_k by what it would move the estimate. Directions in which
/// that is negative are left out.
struct NoiseDoubtInput {
  const Observations* observations = nullptr;
  const SeriesNoise* noise = nullptr;           ///< found
  const Eigen::VectorXd* residual = nullptr;    ///< in the samples' own sigmas
  Eigen::MatrixXd rows;                         ///< d residual / d unknown of this trial
  std::vector<Eigen::Index> place;              ///< of these unknowns among those of all trials
  const Eigen::MatrixXd* normal = nullptr;      ///< A^T A of all trials and priors, whitened
  const Eigen::MatrixXd* covariance = nullptr;  ///< its inverse
  /// `rows` and `place`: of one trial, `parameters` being common to all.
  void TakeRows(const StackedRows& all, std::size_t trial, Eigen::Index parameters);
};
Eigen::MatrixXd DoubtOfNoise(const NoiseDoubtInput& in);

}  // namespace unfurl::correlate
