#pragma once

#include <Eigen/Core>

#include "correlate/fit/autocorrelation.h"
#include "correlate/fit/constancy.h"
#include "correlate/fit/series_noise.h"
#include "correlate/observations.h"

namespace unfurl::correlate {

// Does the model explain a trial? Three questions, each at `kGoodnessLevel`:
// 1. Are the residuals white and no larger than the marks' covariances say (chi-square, Ljung-Box)?
//    A pattern in residuals that are no larger, while the model's own known error is, is explained;
//    so is one of less power, at every frequency, than the covariances say.
// 2. If not: is what is left the model's own known error, which a finer mesh takes away?
// 3. If not: is it noise that stays the same along the record (whitened by what was found of it,
//    nothing follows anything, and every stretch has the same variance, or none has more than the
//    marks' covariances allow)? Then the standard errors
//    hold it. A model that is wrong shows where it is wrong: in bursts, at some time, at some mark.
// 4. Whatever the noise: does all of the record want the same values? Where a smooth effect is
//    missing it does not, and 1 and 3 may pass it: as less than noise, or as noise.
enum class Explained {
  kYes,
  kNoise,  // larger or longer-lived than the marks' covariances, but as noise would be
  kMesh,   // no, and most of it goes with a finer mesh
  kNo,
};

/// Probability that a question rejects a model which does explain the data [-].
inline constexpr double kGoodnessLevel = 0.01;

/// The outcome, and what it rests on.
struct GoodnessOfFit {
  Explained outcome = Explained::kYes;
  double p_size = 1.0;   // of 1, residuals in the marks' sigmas; one-sided [-]
  double p_white = 1.0;  // of 1, over all series [-]
  double p_found = 1.0;  // of 3, whiteness of what is left after whitening [-]
  // Of 3, equal variance along the record, or no stretch beyond what is claimed: covariances that
  // promise too little are no fault of the model [-].
  double p_steady = 1.0;
  Constancy constancy;  // 4
  double excess = 0.0;  // RMS of a coordinate beyond the marks' sigma, in sigmas [-]
  // The residuals are no larger than the covariances allow, and the model's own known error is: a
  // pattern within them is less than what the standard errors hold for that error.
  bool within_known = false;
  // Residuals that follow one another, and are no larger in any stretch and have no more power at
  // any frequency than the covariances say: the record was computed, or its sigmas are too large.
  bool below = false;
  // The residuals are larger than the covariances say, and the model moves between the samples by
  // what they do not show (BetweenSamples): a misfit of that is as white and steady as noise.
  bool hidden = false;
  // Of the excess's square, what a finer mesh takes away, some factor of it: extrapolation gives
  // the shape of the mesh's error better than its size. 0: no finer mesh, or the factor is far
  // from 1.
  double mesh_takes = 0.0;  // [-]

  double p_covariances() const;  // question 1 as a whole
  double p_constant() const;     // question 4, as one of three
  double p_noise() const;        // questions 3 and 4 as a whole
};

// Correlated noise that has less power at every frequency than the samples' covariances say gives
// way to these, series by series; not where those are less than a simulation's tolerance of the
// motion, as a pattern in the residuals may then be the simulation's error.
SeriesNoise Believed(SeriesNoise found, const Observations& observations);

// The smallest ratio of a series' stated noise to its motion, RMS over RMS [-]; infinity: nothing
// moves.
double LeastNoiseOverMotion(const Observations& observations);

// P-value of equal variances: each series (mark and axis) cut into `sections` of time, sums of
// squares against their mean [Bartlett's hypothesis, chi-square to second order]. A series that is
// too short for ten values in each has fewer sections; those with less take no part.
double SteadyPValue(const Observations& observations, const Eigen::VectorXd& residual,
                    int sections);

/// P-value of the largest stretch (series and section) under unit variance: one-sided, Bonferroni.
double LargestStretchPValue(const Observations& observations, const Eigen::VectorXd& residual,
                            int sections);

/// What the tests look at.
struct GoodnessInput {
  const Observations* observations = nullptr;
  const ResidualNoise* plain = nullptr;     // of the residuals in the marks' own sigmas
  const ResidualNoise* whitened = nullptr;  // of those whitened by the noise found
  const Eigen::VectorXd* whitened_residual = nullptr;
  const Eigen::VectorXd* residual = nullptr;  // in the marks' own sigmas; null: not looked at
  double squares = 0.0, dof = 1.0;            // of the former [-]
  // With everything that was fitted taken out: sum of squares of what is left of them, of what a
  // finer mesh changes them by, and their product; all 0: no finer mesh.
  double left = 0.0, finer = 0.0, left_by_finer = 0.0;  // [-]
  bool below = false;                                   // SeriesNoise::below
  int sections = 8;
  const ConstancyInput* constancy = nullptr;  // null: question 4 is not asked
  // What is coarse of the rows, and how they are whitened; null: nothing, and not.
  const QuantisedRows* quantised = nullptr;
  const RowWhitening* whitening = nullptr;
};
GoodnessOfFit TestGoodness(const GoodnessInput& in);

}  // namespace unfurl::correlate
