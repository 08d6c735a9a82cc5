#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "correlate/fit/series_noise.h"
#include "correlate/observations.h"

namespace unfurl::correlate {

/// Shares at and beyond this leave a little white noise, without which a row that repeats the one
/// before would be known for certain [-].
inline constexpr double kLargestShare = 0.9999;
/// The largest correlation from one sample to the next that is looked at, for a longest series of
/// this length [samples].
double LargestRho(double length);

/// One step of the filter for noise of variance 1.
struct FilterStep {
  double decay = 0.0, gain = 0.0, innovation = 1.0;  ///< of the prediction; Kalman; variance
};
/// `gap` in samples; 0: the first. `left` is the state's variance after the row before.
FilterStep StepOfFilter(const MarkovNoise& noise, double gap, double* left);

/// One series: its residuals first, then an orthonormal basis of what the unknowns do to it.
struct NoiseContrasts {
  Eigen::MatrixXd rows;     ///< n x (1 + r)
  std::vector<double> gap;  ///< n, in samples; first 0
  std::size_t mark = 0;
  double dof() const { return static_cast<double>(rows.rows() - rows.cols() + 1); }
};
/// Of every series and axis, in the order of RowLayout::series; as FitSeriesNoise takes them.
std::vector<NoiseContrasts> ContrastsOf(const Observations& observations,
                                        const Eigen::VectorXd& residual, const Eigen::MatrixXd& A);

/// What series add to the restricted likelihood of noise of unit variance.
struct NoisePieces {
  double squares = 0.0;  ///< of the contrasts, whitened
  double logdet = 0.0;
};
NoisePieces PiecesOf(const NoiseContrasts& series, const MarkovNoise& noise);
/// Their restricted log-likelihood at the best variance.
double RestrictedLogLikelihood(const NoisePieces& pieces, double dof, double* variance);

/// What shares one noise: all series, those of each mark, or each series alone.
enum class Pooling { kAll, kByMark, kNone };
const char* Name(Pooling pooling);  // as SeriesNoise::pooled
/// Indices of those that tell something of their noise, those that share one together.
std::vector<std::vector<std::size_t>> GroupsOf(const std::vector<NoiseContrasts>& all,
                                               Pooling pooling);

}  // namespace unfurl::correlate
