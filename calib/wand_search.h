#pragma once

#include <string>
#include <vector>

#include "calib/wand_fit.h"

namespace unfurl::calib {

// All data take part, with one floor for all cameras.
WandWeighting EqualWandWeighting(const WandData& data, double floor_px);
// Of the readings' stated sigmas [px].
double MedianSigma(const WandData& data);

// Bundles with the loss and one floor for all, which follows the residuals' scale, until it stays;
// that scale [px], infinite where no pose is left that tells.
double RobustWand(const BundleOptions& options, WandFit* fit);

/// The first cameras, found from some of the poses, without surveyed points.
struct WandSearch {
  WandFit best;
  std::vector<WandRival> rivals;  // other minima that explain the readings as well
  bool fits = false;              // residuals are near the stated ones
};

// Every end of the search from nothing (or the one from known cameras) that leads to residuals near
// the stated ones is followed up; the most probable is taken, else the one of least residuals.
// Throws Error where no end leads anywhere.
WandSearch SearchWand(const WandData& data, const WandFitOptions& options,
                      const std::string& where);

}  // namespace unfurl::calib
