#pragma once

#include <vector>

#include "calib/wand.h"
#include "calib/wand_frame.h"

namespace unfurl::calib {

// How the found points as a whole may be stretched or sheared and fit the readings as well: the
// principal directions of the strain's covariance, widest first, in words. `bar_sigma` is what the
// bar's stated length leaves open of every length [-].
std::vector<WandShape> ShapesOf(const WandFit& fit, const Eigen::MatrixXd& covariance,
                                const std::vector<WandGridPoint>& grid);

// Standard deviation of the distance of two found points by the calibration, root mean square over
// pairs of the grid [m]; and of a found point by calibration and readings, each point of the grid.
double DistanceSigma(const Eigen::MatrixXd& covariance, const std::vector<WandGridPoint>& grid);
std::vector<double> PointSigmas(const Eigen::MatrixXd& covariance,
                                const std::vector<WandGridPoint>& grid);

// Folds of poses are left out in turn, the rest calibrated from the fit of all, and the outer
// marks' distance in those left out found from their readings. Folds run in parallel.
struct WandLengths {
  std::vector<WandLength> found;
  int unsolved = 0;
};
WandLengths HeldOutLengths(const WandFit& fit, const BundleOptions& options, int folds,
                           std::size_t workers);

// How far a bar that moves between its marks' flashes leaves their distance open, and how far the
// readings do; medians over poses; and its speed.
void MotionOf(const WandFit& fit, WandReport* report);

// Of each camera's residuals, smooth functions of the order of poses and of the place on the row:
// sentences for those that are less probable than `level` for all together. Projections are not
// taken off, which makes the test find less and never more.
std::vector<std::string> WandTrends(const WandFit& fit, double level);

}  // namespace unfurl::calib
