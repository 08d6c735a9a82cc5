#pragma once

#include <string>
#include <vector>

#include "correlate/align/registration.h"

namespace unfurl::correlate {

/// An unknown of a registration. Which of them there are, and in which column each stands, depends
/// on the options: ask for the kind, never count.
struct Nuisance {
  enum class Kind {
    kRotation,  ///< w of X_WM <- Exp(w) about the centroid of the predicted marks [rad]
    kShift,     ///< of that centroid, in W [m]
    kOffset,    ///< [s]
    kDrift,     ///< [-]
    kDraw,      ///< of the calibration [-]
  };
  Kind kind = Kind::kOffset;
  int index = 0;  ///< axis of a rotation or shift, number of a draw, from 0

  std::string Name() const;  ///< "frame shift along x"
  const char* Unit() const;
};

/// In the order of the columns of RegistrationFit::jacobian. Those that are not fitted have none.
std::vector<Nuisance> Nuisances(const RegistrationOptions& options, int shared_rank);

/// The one of this name. Throws std::invalid_argument for a name that none has.
Nuisance NuisanceNamed(const std::string& name);

/// Its value at the solution, in its unit.
double ValueOf(const Nuisance& nuisance, const RegistrationFit& fit);

}  // namespace unfurl::correlate
