#pragma once

#include <string>
#include <vector>

#include "correlate/align/registration.h"

namespace unfurl::correlate {

/// An unknown of a registration. Which of them there are, and in which column each stands, depends
/// on the options: ask for the kind, never count.
struct Nuisance {
  /// What it is an unknown of.
  enum class Kind {
    kRotation,  ///< w of X_WM <- Exp(w) about the centroid of the predicted marks [rad]
    kShift,     ///< of that centroid, in W [m]
    kOffset,    ///< [s]
    kDrift,     ///< [-]
    kOwn,       ///< of a residual kind
    kDraw,      ///< of the calibration [-]
  };
  Kind kind = Kind::kOffset;
  int index = 0;  ///< axis of a rotation or shift, number of a draw or of a kind's own, from 0
  std::string own_name = {}, own_unit = {};  ///< of a kind's own

  std::string Name() const;  ///< "frame shift along x"
  std::string Unit() const;  ///< "rad"
};

/// In the order of the columns of RegistrationFit::jacobian. Those that are not fitted have none.
std::vector<Nuisance> Nuisances(const RegistrationOptions& options,
                                const Observations& observations);

/// Their names.
std::vector<std::string> NamesOf(const std::vector<Nuisance>& nuisances);

/// Its value at the solution, in its unit.
double ValueOf(const Nuisance& nuisance, const RegistrationFit& fit);

}  // namespace unfurl::correlate
