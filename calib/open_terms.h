#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "calib/bundle.h"
#include "calib/observations.h"
#include "calib/refine.h"
#include "data/rig.h"

namespace unfurl::calib {

/// A lens term that a camera's fit leaves out.
struct OpenTerm {
  int camera = 0, term = 0;  // indices
  double sigma_px = 0.0;     // of its prior, were it taken [px]
};
// Those of `richest` that are held at zero in `priors`.
std::vector<OpenTerm> ListOpenTerms(const std::vector<CameraPrior>& priors,
                                    const std::vector<CameraPrior>& richest);

/// A fit in which they take part.
struct OpenFit {
  const std::vector<data::RigCamera>* cameras;
  Eigen::MatrixXd covariance;  // of the cameras' parameters, at least 31 c x 31 c [SI, px]
};

/// What the lens terms that a fit leaves out may amount to, as far as its residuals tell.
struct OpenTerms {
  bool taken = false;  // they take part now, with priors as small as the data say
  // By what share squared errors of found points were larger than the fit without them stated [-].
  double rise = 0.0;
  // RMS over the readings of what they are estimated to do [px].
  double rms_px = 0.0;
};

// A set of terms is chosen for the accuracy of points: what it leaves out is then about as large as
// its own uncertainty would be, and in no error bar. So each term that camera j leaves out is
// thought N(0, tau_j^2) in units of its prior, tau_j uniform from 0 to 1, and either all cameras'
// alike or each its own, as the evidence says; the data are fitted with the tau_j that tell as many
// terms as the posterior does on the average. Where glass makes none of them tau_j is about what
// the data would not show, and error bars stay; where it does they are as wide as the data leave it
// open. [evidence of a variance: MacKay (1992), Neural Computation 4, 415]
//
// Fits with priors of such sizes, from those of `tau` (one for each term) on, until they stay; the
// last call of `fit` had the priors that are left.
void FitOpenTerms(const std::vector<OpenTerm>& open, Eigen::VectorXd tau,
                  const std::function<OpenFit(const std::vector<CameraPrior>&)>& fit,
                  std::vector<CameraPrior>* priors);

// Of a survey's bundle. Nothing is changed where squared errors of found points gain less than a
// fiftieth.
OpenTerms TakeOpenTerms(const Observations& data, const std::vector<CameraPrior>& richest,
                        const RefineOptions& options, std::vector<CameraPrior>* priors,
                        RefinedBundle* bundle);

}  // namespace unfurl::calib
