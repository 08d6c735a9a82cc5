#pragma once

#include <string>
#include <vector>

#include "correlate/align/registration.h"

namespace unfurl::correlate {

/// One sample that sticks out.
struct GrossSample {
  std::size_t mark = 0, index = 0;  ///< into Observations::marks, 0 of a channel; its samples
  double t = 0.0;                   ///< on the record's clock [s]
  double sigmas = 0.0;              ///< how far it lies from its neighbours' residuals [-]
};

/// Gross errors among the samples of one trial's marks, or the readings of a channel.
struct GrossErrors {
  std::vector<GrossSample> samples;  ///< by mark, then time; empty: there are none
  double widening = 1.0;             ///< RMS of a coordinate of theirs, in the samples' sigmas [-]
  double clean = 1.0;                ///< the same of all others [-]
  /// There are samples that stick out, but they come together or are more than a fifth of all: that
  /// is motion which the model lacks, or a disturbance, and nothing is put aside.
  std::size_t in_bursts = 0;
  std::vector<GrossSample> suspects;  ///< those
};

/// Looks for gross errors in residuals (3 a sample, in the samples' sigmas, no whitening in time;
/// 0: unknown). Each is taken against the median of the three before and the three after it, so
/// that a model which is wrong in a smooth way, or a fit that the errors have bent, does not count.
/// Whether there are any is decided by the data: a mixture of two normal densities [McLachlan and
/// Peel 2000] against one, by the Bayesian information criterion. A sample is gross where the wider
/// density is the likelier; densities less than three times as wide as each other cannot be told
/// apart.
GrossErrors FindGrossErrors(const Observations& observations, const Eigen::VectorXd& residual);

/// Widens the covariances of the gross samples, and of suspects, to what they are.
void PutAside(const GrossErrors& gross, Observations* observations);

/// Gross errors among the readings of one channel.
struct ChannelGross {
  std::size_t kind = 0;      ///< into Observations::others
  std::string name;          ///< of the channel
  std::size_t readings = 0;  ///< that the model has something for
  GrossErrors errors;
};

/// Likewise in the residuals of channels, each on its own, no whitening in time. What the model
/// does at once (a rate that jumps, a peak as an impact leaves it) and does a sample early or late
/// leaves single residuals, too, up to twice as large as what it does there: these are the impact's
/// time and no gross errors. Nor is what lies within two steps of the instrument's resolution.
/// Channels without any are left out.
std::vector<ChannelGross> FindChannelGross(const Observations& observations,
                                           const Eigen::VectorXd& residual);

/// Puts the readings aside, and suspects, and no others.
void PutAside(const std::vector<ChannelGross>& gross, Observations* observations);

}  // namespace unfurl::correlate
