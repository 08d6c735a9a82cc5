#pragma once

#include <string>
#include <vector>

#include "correlate/align/registration.h"

namespace unfurl::correlate {

// How far a record lies from a model, after alignment. All in the model's frame: "in plane" are x
// and y, "across" is z, the direction in which a planar model does not move.
struct MarkError {
  std::string mark;            // or "all"
  std::size_t samples = 0;     // with a counterpart
  double rmse = 0.0;           // of the distance [m]
  double rmse_in_plane = 0.0;  // [m]
  double rmse_across = 0.0;    // [m]
  double bias_across = 0.0;    // mean of z [m]
  double largest = 0.0;        // distance [m]
  double largest_at = 0.0;     // on the record's clock [s]
  double sigmas = 0.0;         // RMS of the whitened residual: 1 where the model is right and the
                               // covariances are too; 0 for a record without sigma [-]
  double largest_sigmas = 0.0;
};

// One entry per mark, then "all".
std::vector<MarkError> Errors(const Observations& observations, const Prediction& prediction,
                              const Clock& reference, const RegistrationFit& fit);

// The record's marks in the model's frame, the calibration's draw taken out, per mark 3 x n.
std::vector<Eigen::Matrix3Xd> InModelFrame(const Observations& observations,
                                           const Registration& at);

// Standard deviations of x, y, z in the model's frame, per mark 3 x n [m]: each sample's own error
// and, in quadrature, what the calibration adds.
std::vector<Eigen::Matrix3Xd> SigmasInModelFrame(const Observations& observations,
                                                 const Registration& at);

// A mean beside the root mean square of the same numbers [m], as "0.2 mm"; "0" where it is their
// rounding.
std::string MeanText(double mean, double rms);

}  // namespace unfurl::correlate
