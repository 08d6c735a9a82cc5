#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/observations.h"
#include "calib/score_test.h"

namespace unfurl::calib {

/// What a fit's residuals may follow that no model parameter makes.
enum class TrendKind {
  kReadingDrift,  // of a camera's readings with the order of measuring
  kSurveyDrift,   // of the surveyed places with the order of measuring
  kPattern,       // of a camera's readings over its field
  kSurveyShape,   // of the surveyed places over the volume
  kLensRest,      // none: of what the lens model lacks, no residual tells (calib/lens_rest.h)
  kOutermost,     // a reading that was left out where no others are near (calib/outermost.h)
};

/// Smooth functions of one kind, each of unit mean square, with independent N(0, t^2 d_k)
/// coefficients.
struct Family {
  TrendKind kind = TrendKind::kReadingDrift;
  int camera = -1;  // -1: of the survey
  Columns columns;
  std::vector<double> prior;  // d_k: slow functions count most [-]
};

/// Functions of the order of measuring, points x m: the straight line, then half waves [-].
Eigen::MatrixXd TimeWaves(int points);

/// A camera's readings drift; `waves` of TimeWaves.
Family DriftOfReadings(const Observations& data, const ScoreTest& test, int camera,
                       const Eigen::MatrixXd& waves);
/// The surveyed places drift, along each axis by itself.
Family DriftOfSurvey(const Observations& data, const Eigen::MatrixXd& waves);
/// A camera's readings follow its field: half waves along the row, and products with half waves
/// across it.
Family PatternOf(const Observations& data, const RefinedBundle& bundle, const ScoreTest& test,
                 int camera);
/// The surveyed places are distorted over their box: products of half waves along its axes.
Family ShapeOfSurvey(const Observations& data, const RefinedBundle& bundle);

}  // namespace unfurl::calib
