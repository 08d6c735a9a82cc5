#pragma once

#include <vector>

#include "calib/bundle.h"
#include "calib/observations.h"
#include "calib/weighting.h"

namespace unfurl::calib {

/// Of the test for gross errors.
struct GrossOptions {
  // Sizes of errors are as likely in each octave from so many sigmas up to the row, or the surveyed
  // volume. Where one in a hundred is gross, leaving out a reading that is off by 4 sigmas must
  // then gain about 4^2, which chance reaches once in 16,000; one off by more, as much more as it
  // is less likely to be off by just that: d sigmas cost 2 log d more, a surveyed place 6 log d.
  double sigmas = 4.0;  // [-]
  // Share of the readings and of the surveyed points that is gross; Refine finds it from the data,
  // between `least_share` and `most_share`.
  double reading_share = 0.01, survey_share = 0.01;  // [-]
  double least_share = 0.01, most_share = 0.2;       // [-]
  // A datum that is wrong with a probability above this is left out, be it or another the wrong
  // one.
  double doubt = 0.3;  // [-]

  // Throws Error that names a value which makes no sense.
  void Check() const;
};

// For each point, given the cameras: which of its readings and its survey to believe. Every subset
// is tried, fitted by least squares, and weighed by its posterior probability: exp(-price / 2) with
// chi-square, what it pays for what it leaves out, and the logarithm of the determinant of the
// point's information. Which one of four readings is wrong is so decided by the survey, and whether
// the survey is, by the readings. Left out is what the most probable subset leaves out and what is
// wrong with a probability above `doubt`. Sets weighting->use_* and moves state->points to where
// the rest has them. `ambiguous` holds the points at which another subset is about as probable
// (within e^2): something is wrong there, and of what was left out not all need be.
// `changed`: a choice differs from before. The shares are the expected ones, not yet limited.
struct GrossChoice {
  bool changed = false;
  std::vector<int> ambiguous;
  double reading_share = 0.0, survey_share = 0.0;  // [-]
  // -2 log of how probable all data are as chosen, but for a constant: what two fits of the same
  // data with other floors and choices are compared by.
  double price = 0.0;  // [-]
};
GrossChoice ChooseGross(const Observations& data, const GrossOptions& options, Weighting* weighting,
                        BundleState* state);

// A point from those of its readings (data.readings from `first` on, while they are of that point)
// whose bit is set in `use`, and from its survey unless that is left out: least squares from
// `start`. False where they do not fix it or do not lead anywhere.
struct PointFit {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();    // [m]
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();  // [m^2]
  double chi_square = 0.0;                        // [-]
};
bool FitPoint(const Observations& data, const Weighting& weighting,
              const std::vector<data::RigCamera>& cameras, std::size_t first, unsigned use,
              bool with_survey, const Eigen::Vector3d& start, PointFit* out);

}  // namespace unfurl::calib
