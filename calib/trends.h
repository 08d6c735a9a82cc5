#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/bundle.h"
#include "calib/observations.h"
#include "calib/refine.h"
#include "calib/trend_families.h"

namespace unfurl::calib {

/// What messages call it.
const char* Name(TrendKind kind);

/// One test of the residuals.
struct Trend {
  TrendKind kind = TrendKind::kReadingDrift;
  int camera = -1;      // -1: of the survey
  double chance = 1.0;  // of so much structure without a cause [-]
  bool found = false;   // the least probable that does harm, and less so than the level allows
  // Of a trend less probable than the level allows: by what share it raises the mean squared error
  // of found points above what the rig states (ScoreTest::RiseOfError); else 0 [-].
  double rise = 0.0;
  // What is estimated of it: RMS over the data and its standard deviation [px], of a survey [m].
  double rms = 0.0, sigma = 0.0;
  // From the first to the last of the order of measuring, of a drift of readings [px].
  double change = 0.0;
  // A sentence: with the remedy where found, or that it is there and harmless; else empty.
  std::string text;
};

/// Of the tests of residuals.
struct TrendOptions {
  // Of all tests together on data without a trend: one calibration in a hundred is so suspected
  // wrongly [-].
  double level = 0.01;
  // A trend that raises squared errors of found points by a smaller share is harmless: with a
  // tenth, 93% of errors and not 95 lie within ellipsoids of 95% [-].
  double harmless = 0.1;
  // Likewise of a steady drift that the tests may as well miss (calib/unseen_drift.h): more, and
  // the order of measuring hides what error bars would have to hold. With 0.3 89% of errors lie
  // within ellipsoids of 95% [-].
  double unseen = 0.3;
  // Of the row: no lens is further off where its camera has no other readings, and of gross
  // errors anywhere on the row one in fifty falls so near [-].
  double lens_share = 0.01;
  // Nothing moved during the survey, as something other than the survey shows: `unseen` is not
  // asked.
  bool steady = false;

  // Throws Error that names a value which makes no sense.
  void Check() const;
};

/// What tests of a fit's residuals gave.
struct TrendResult {
  std::vector<Trend> trends;
  // The drift of a camera's readings, if that was found, at each reading against the end of the
  // survey [px]; else empty.
  std::vector<double> drift_px;
  // What not knowing it better adds to the covariance of the cameras, 31 c x 31 c [SI, px].
  Eigen::MatrixXd covariance;
};

/// Tests the residuals of a least-squares bundle against smooth functions of the order of measuring
/// (that of the points in `data`), of the place on each sensor, and of the place in the volume: the
/// score of each family of functions with independent N(0, t^2 d_k) coefficients, by its exact
/// covariance after the fit of cameras and points. [score test of a variance component: Lin 1997]
TrendResult TestTrends(const Observations& data, const std::vector<CameraPrior>& priors,
                       const RefinedBundle& bundle, const TrendOptions& options = {});

/// Readings less the drift.
Observations WithoutDrift(Observations data, const TrendResult& trends);

}  // namespace unfurl::calib
