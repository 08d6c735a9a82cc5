#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "correlate/observations.h"

namespace unfurl::correlate {

// An autoregressive model x_i = sum_j a_j x_(i-j) + e_i of a zero-mean series, by Burg's method
// over the contiguous stretches of the series (a gap ends a stretch), order by the Bayesian
// information criterion. Its zeros lie inside the unit circle, so its autocorrelation decays.
struct Autoregression {
  std::vector<double> a;    // order p; empty: white [-]
  double variance = 0.0;    // of x [unit of x, squared]
  double innovation = 0.0;  // variance of e [the same]
  std::size_t count = 0;    // values used

  // Autocorrelation at lags 0 .. max_lag.
  std::vector<double> Correlation(std::size_t max_lag) const;
  // Effective number of independent values in the mean of `count` of them.
  double EffectiveCount() const;
};
Autoregression FitAutoregression(std::span<const double> x, std::span<const std::uint8_t> known,
                                 int max_order = 6);

// Ljung-Box statistic of a series: of `lags` autocorrelations, chi-square with as many degrees of
// freedom for white noise. Gaps are left out. Negative: too few values.
double LjungBox(std::span<const double> x, std::span<const std::uint8_t> known, int lags);
// Its p-value; 1 for too few.
double WhitenessPValue(std::span<const double> x, std::span<const std::uint8_t> known, int lags);

// The noise that whitened residuals turn out to have, series by series (mark and axis).
//
// A sandwich estimate: where residuals are correlated in time, or larger than their covariances
// say, the covariance of a least-squares estimate with rows J is  H^-1 (J^T G J + P) H^-1,
// H = J^T J + P, with P the priors' part and G block-diagonal over the series: G = variance times
// the Toeplitz matrix of the autoregression's correlation. A variance below 1 is taken as 1: the
// covariances of the samples are believed unless the residuals say that they are too small.
struct ResidualNoise {
  // Of one axis of one mark.
  struct Series {
    std::string mark;
    int axis = 0;  // 0, 1, 2: rows of the whitened residual
    Autoregression model;
    double p_value = 1.0;           // of whiteness [-]
    std::vector<Eigen::Index> row;  // rows in the stacked residual, in order of time
    std::vector<std::size_t> slot;  // sample's place on the mark's even grid
  };
  std::vector<Series> series;
  double p_together = 1.0;       // of all series being white, their statistics added up [-]
  double smallest_p = 1.0;       // over all series, times their number (Bonferroni) [-]
  double effective_share = 1.0;  // effective over nominal number of samples, mean of series [-]
  double variance = 1.0;         // mean square of the whitened residuals [-]

  // At one in a hundred, over all series.
  bool white() const { return smallest_p > 0.01; }

  // J^T G J for the data rows of J (rows beyond them, the priors', are not looked at).
  Eigen::MatrixXd Middle(const Eigen::MatrixXd& J) const;
};

// `residual`: the rows of a registration, whitened. Rows of exactly 0 in all axes are samples
// without a counterpart.
ResidualNoise EstimateResidualNoise(const Observations& observations,
                                    const Eigen::VectorXd& residual, double unit_variance = 1.0);

}  // namespace unfurl::correlate
