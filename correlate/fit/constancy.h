#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "correlate/align/registration.h"
#include "correlate/fit/quantised.h"
#include "correlate/observations.h"
#include "correlate/residual/change.h"

namespace unfurl::correlate {

/// Whether all of a record wants the same values. A model that is right wants them, whatever the
/// noise; one that lacks an effect wants others as the motion's size or rate changes: viscous
/// damping in place of friction is less where the swings are large, and more where they are small.
/// Residuals of such a model are smooth, and a noise model alone takes them for noise.
struct Constancy {
  /// Of the parameters, the clock and the size of the motion staying the same along the record,
  /// whatever noise of SeriesNoise's kind the data have; 1: not tested [-].
  double p_value = 1.0;
  /// What changes most surely by itself: a parameter's index, or one of the two below; -1: none.
  int most = -1;
  /// Of that, by a straight line in time: its value at the record's begin and end less the
  /// estimate's [unit; s; part of the motion].
  double at_begin = 0.0, at_end = 0.0;
  int parameters = 0;  ///< how many there are: `most` beyond the last is clock, then size
  /// Of the rival laws, the one that the data want most surely, where they want it more surely than
  /// other values: its index; -1: none. How much of it they want, over what its model has, with the
  /// standard error by the noise found with it, and by how much the parameters would change [unit].
  int rival = -1;
  double rival_part = 0.0, rival_sigma = 0.0;
  std::vector<double> with_rival;
  bool clock() const { return most == parameters; }
  bool size() const { return most == parameters + 1; }
};

/// What it looks at: one trial at its estimate, rows in the samples' own sigmas.
struct ConstancyInput {
  const Observations* observations = nullptr;
  const Prediction* prediction = nullptr;  ///< at StampsAt(reference)
  Clock reference;
  Registration at;
  RegistrationOptions registration;
  const Eigen::VectorXd* residual = nullptr;  ///< of a registration, residual kinds included
  const Eigen::MatrixXd* jacobian = nullptr;  ///< d residual / d nuisance
  Eigen::MatrixXd sensitivity;                ///< d residual / d parameter [1/unit]
  /// A p-value below this is looked at again, by drawn noise; costs 24 times as much [-].
  double calibrated_below = 0.01;
  const QuantisedRows* quantised = nullptr;  ///< rows that are no noise; null: none
  Change known;  ///< the model's own error, of which nothing is held against it; empty: none
  /// What laws that the model lacks would change (FitTrial::rivals), empty ones not asked; null:
  /// none.
  const std::vector<Change>* rivals = nullptr;
};

/// An F-test by generalised least squares, to first order, without a run of the model: columns of
/// the sensitivities, of the clock and of the motion's size times Legendre polynomials of time are
/// added to the fit; the noise is that which is left with them in it (FitSeriesNoise), so that a
/// misfit of their shape is not taken for noise. Rival laws are asked for in the same way, each by
/// one column, with half of the probability of a false alarm: of one column noise imitates less.
Constancy TestConstancy(const ConstancyInput& in);

}  // namespace unfurl::correlate
