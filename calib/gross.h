#pragma once

#include <vector>

#include "calib/bundle.h"
#include "calib/observations.h"
#include "calib/weighting.h"

namespace unfurl::calib {

struct GrossOptions {
  // What leaving out one reading must gain, in sigmas: 4 are reached by chance once in 16,000.
  // Leaving out a point's survey must gain what three coordinates reach as rarely.
  double sigmas = 4.0;
};

// For each point, given the cameras: which of its readings and its survey to believe. Every subset
// is tried, fitted by least squares, and charged for what it leaves out; the cheapest is taken.
// Which one of four readings is wrong is so decided by the survey, and whether the survey is, by
// the readings. Sets weighting->use_* and moves state->points to where the chosen data have them.
// `ambiguous` holds the points at which another choice is about as cheap (a factor below e^2 in
// likelihood): something is wrong there, and what was left out may be the wrong thing.
// Returns whether a choice differs from before.
struct GrossChoice {
  bool changed = false;
  std::vector<int> ambiguous;
};
GrossChoice ChooseGross(const Observations& data, const GrossOptions& options, Weighting* weighting,
                        BundleState* state);

// A point from those of its readings (data.readings from `first` on, while they are of that point)
// whose bit is set in `use`, and from its survey unless that is left out: least squares from
// `start`. False where they do not fix it or do not lead anywhere.
struct PointFit {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
  double chi_square = 0.0;
};
bool FitPoint(const Observations& data, const Weighting& weighting,
              const std::vector<data::RigCamera>& cameras, std::size_t first, unsigned use,
              bool with_survey, const Eigen::Vector3d& start, PointFit* out);

}  // namespace unfurl::calib
