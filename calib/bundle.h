#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "calib/observations.h"
#include "calib/weighting.h"
#include "data/rig.h"

namespace unfurl::calib {

// What is believed of a camera before its readings speak: weak, in physical units, and there so
// that a direction which the survey does not determine stays near something sensible instead of
// being declared known (a term fixed at zero) or left to drift.
struct CameraPrior {
  double e_mean = 0.03, e_sigma = 0.03;  // distance between the two centres [m]
  // Position along the lens axis: axis . p_WC = along +- along_sigma; axis a unit vector in W.
  Eigen::Vector3d axis = Eigen::Vector3d::UnitY();  // [-]
  double along = 0.0, along_sigma = 1.0;            // [m]
  data::LensModel lens = data::LensModel::kRectilinear;
  // Of each term's coefficient, about zero [px]; 0: the term is held at zero, not part of the
  // model.
  std::array<double, data::kLensTerms> term_sigma_px{};
  // Of each coefficient, what makes 1 px at the edge of the field [px].
  std::array<double, data::kLensTerms> term_unit_px{};
  // Of a lens known from a calibration before (calib/known_lens.h), in the place of what is said
  // above of e and the terms: |root (lens - mean)|^2. Empty: none is.
  Eigen::VectorXd lens_mean = Eigen::VectorXd();
  Eigen::MatrixXd lens_root = Eigen::MatrixXd();
  bool KnowsLens() const { return lens_mean.size() > 0; }

  // Whether a term is held at zero.
  bool Fixed(int term) const { return term_sigma_px[static_cast<std::size_t>(term)] == 0.0; }
};

/// Of the loss, and when the search ends.
struct BundleOptions {
  // A whitened residual is squared up to this many sigmas; beyond, its pull falls off as 1/r.
  // Infinity: least squares of what takes part [-].
  double loss_width = 3.0;
  int max_iterations = 100;
  double function_tolerance = 1e-10;  // of the cost, relative: where the search ends [-]
  bool fix_points = false;            // hold the points where the survey has them
};

/// All unknowns of a bundle.
struct BundleState {
  std::vector<data::RigCamera> cameras;  // c
  Eigen::Matrix3Xd points;               // 3 x n [m]
  // Of the survey's common errors, in their sigmas; empty: not yet solved for, all 0.
  Eigen::VectorXd common = Eigen::VectorXd();  // [-]
};

// How a bundle ended; the numbers are at the solution.
struct BundleSummary {
  // The cost changed no more, or is at its minimum to within a tenth of a standard error in the
  // worst direction.
  bool converged = false;
  int iterations = 0;
  // Sum of squared whitened residuals of the readings and surveyed points that lie in the loss's
  // quadratic core, and its degrees of freedom: readings, less three for each surveyed point
  // outside the core, less what the data (not the priors) determine of the cameras. With fixed
  // points both are of the readings alone.
  double chi_square = 0.0;          // [-]
  double degrees_of_freedom = 0.0;  // [-]
  // Of the cameras, 31 c x 31 c, and after them the common errors, unless the points were fixed;
  // priors included (calib/covariance.h).
  Eigen::MatrixXd information;      // [1/(unit x unit)]
  std::vector<double> residual_px;  // u - prediction, per reading; NaN: the point is behind [px]
  // Of the loss, 1 in the core; 0 if the reading is left out or the point is behind.
  std::vector<double> reading_weight;  // [-]
  std::vector<double> survey_weight;   // the same per point; Weighting::kLeftOut if left out [-]

  int gross_readings() const;  // with a weight below 1
  int gross_points() const;    // likewise
  // 0 without degrees of freedom.
  double chi_square_per_dof() const {
    return degrees_of_freedom > 0.0 ? chi_square / degrees_of_freedom : 0.0;
  }
};

// Minimises, over all cameras' 31 parameters and the points,
//   sum_r loss((u_r - h(c, P))^2 / (s_r^2 + floor^2)) + sum_i loss(|P_i - p_i|^2 in the metric of
//   the survey's covariance, common errors taken off p_i) + the priors,
// with Ceres and the analytic derivatives of measure::Project, starting from `state`, over what
// `weighting` lets take part. A reading whose point starts behind its camera takes no part.
BundleSummary SolveBundle(const Observations& data, const std::vector<CameraPrior>& priors,
                          const Weighting& weighting, const BundleOptions& options,
                          BundleState* state);

// The loss on a squared whitened residual s, which has `dimensions` components: s up to w^2, then
// w^2 (1 + log(s / w^2)). It is least squares for what is plausible, so that clean data lose no
// efficiency, and its influence redescends as Cauchy's does for what is not.
double Loss(double s, double width);
double LossWeight(double s, double width);  // its derivative by s
// The width that leaves the same share of good data outside for a survey point's three coordinates
// as `width` does for one reading.
double SurveyLossWidth(double width);

}  // namespace unfurl::calib
