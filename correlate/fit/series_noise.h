#pragma once

#include <Eigen/Core>
#include <cmath>
#include <string>
#include <vector>

#include "correlate/observations.h"

namespace unfurl::correlate {

// Noise of one series of residuals (a mark's axis, in units of the samples' own sigma):
//   variance * ((1 - share) I + share R),   R_ij = rho^|slot_i - slot_j|,
// white noise and a first-order Markov process side by side: what a reading scatters by, and what
// drifts along (optics that are wrong in a smooth way, a model that is not quite the structure).
struct MarkovNoise {
  double variance = 1.0;  // of the whole [-]
  double share = 0.0;     // of it that is correlated, [0, 1]; 0: white [-]
  double rho = 0.0;       // correlation from one sample to the next, [0, 1) [-]
  bool white() const { return share <= 0.0; }  // nothing of it is correlated
  // The largest of its power over that of white noise of variance 1, at frequency 0 [-].
  double Peak() const { return variance * (1.0 - share + share * (1.0 + rho) / (1.0 - rho)); }
};

// A noise per series and axis, in the order of RowLayout::series, and how it was found.
struct SeriesNoise {
  std::vector<MarkovNoise> series;
  std::string pooled;  // "all series", "each mark", "each series": what shares one noise
  // Twice the gain in restricted log-likelihood over white noise of the samples' own sigma [-].
  double gain = 0.0;
  bool below = false;  // Believed() took the covariances in all series instead
  bool white() const;  // of variance 1, all of them
};

// Restricted maximum likelihood [Patterson and Thompson 1971]: the likelihood of those contrasts of
// the residuals that no change of the unknowns (columns of A) touches, so the noise is not thought
// smaller, or less correlated, for what the fit took out of it. Each series gives its own
// contrasts. Whether it is white, and whether marks or series differ, is decided by the Bayesian
// information criterion. A variance below 1 of white noise is taken as 1: the samples' covariances
// are believed unless the residuals say that they are too small (Believed() does it for others).
//
// `residual` and `A` are those of a registration; rows of no series are not looked at, nor are
// those of a sample whose residuals are exactly 0. The last `observations.shared_rank` columns of A
// are those of the calibration's draw, of variance 1.
SeriesNoise FitSeriesNoise(const Observations& observations, const Eigen::VectorXd& residual,
                           const Eigen::MatrixXd& A);

// L with L G L^T = I for the noise G of all series: rows become innovations, in order of time. By
// a Kalman filter, O(rows) per column.
class RowWhitening {
 public:
  RowWhitening() = default;  // the identity
  RowWhitening(const Observations& observations, const SeriesNoise& noise);
  bool identity() const { return inverse_sd_.empty(); }  // changes nothing
  // In place, column by column; rows of no series stay as they are.
  void Apply(Eigen::Ref<Eigen::MatrixXd> rows) const;
  /// Of the noise's covariance, the logarithm of its determinant; rows of exactly 0 take no part.
  double LogVariances(const Eigen::VectorXd& residual) const {
    double sum = 0.0;
    for (const Part& part : parts_) {
      for (Eigen::Index i = 0; i < part.rows; ++i) {
        if (residual(part.first + i) == 0.0) continue;
        sum -= 2.0 * std::log(inverse_sd_[part.at + static_cast<std::size_t>(i)]);
      }
    }
    return sum;
  }

 private:
  // Rows of one series, and where its numbers begin below.
  struct Part {
    Eigen::Index first = 0, rows = 0, axes = 3;
    std::size_t at = 0;
  };
  std::vector<Part> parts_;
  // Row by row: decay of the prediction since the same axis of the sample before (0 at a series'
  // first), Kalman gain, one over the innovation's standard deviation [-].
  std::vector<double> decay_, gain_, inverse_sd_;
};

}  // namespace unfurl::correlate
