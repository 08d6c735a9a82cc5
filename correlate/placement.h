#pragma once

#include <limits>
#include <string>

#include "base/pose.h"

namespace unfurl::correlate {

/// How well something is known before the data are looked at.
enum class Foreknowledge {
  kUnsaid,  ///< nothing was said: what is fitted depends on the options
  kFree,    ///< nothing is known: it is fitted
  kNormal,  ///< a normal density; it is fitted, with that as a prior
  kKnown,   ///< its value is known: it is not fitted
};

/// What is known beforehand of one number.
struct Prior {
  Foreknowledge kind = Foreknowledge::kUnsaid;
  double mean = 0.0;   ///< of a density; or the known value [s] or [-]
  double sigma = 0.0;  ///< of a density; > 0 [s] or [-]
  /// It is fitted.
  static Prior Free() { return {Foreknowledge::kFree, 0.0, 0.0}; }
  /// It is not fitted.
  static Prior Known(double value) { return {Foreknowledge::kKnown, value, 0.0}; }
  /// It is fitted, with this density.
  static Prior Normal(double mean, double sigma) { return {Foreknowledge::kNormal, mean, sigma}; }
  /// Something of its value was said.
  bool Told() const { return kind == Foreknowledge::kNormal || kind == Foreknowledge::kKnown; }
};

/// What is known beforehand of the frame in which a record was measured. Of a density: the vector
/// of the rotation away from `X_WM`, and the place of the model's origin, each axis by itself.
struct FramePrior {
  Foreknowledge kind = Foreknowledge::kUnsaid;
  Pose X_WM = Pose::Identity();  ///< from the model's frame M to the record's frame W
  double sigma_rotation = 0.0;   ///< [rad], > 0 of a density
  double sigma_shift = 0.0;      ///< [m], > 0 of a density
  /// Something of its value was said.
  bool Told() const { return kind == Foreknowledge::kNormal || kind == Foreknowledge::kKnown; }
};

/// What is known beforehand of how a record sits against a model.
struct Placement {
  Prior offset;  ///< what the record's clock shows when the model's shows 0 [s]
  Prior drift;   ///< by how much the record's clock runs fast [-]
  FramePrior frame;
  /// Stamp at which a drift has no effect [s]; NaN: the record's middle.
  double pivot = std::numeric_limits<double>::quiet_NaN();
};

/// A record's clock: by the model's it is  pivot + (t - pivot) / (1 + drift) - offset  when the
/// record's shows t.
struct Clock {
  double offset = 0.0;  ///< [s]
  double drift = 0.0;   ///< [-]
  Clock() = default;
  Clock(double offset_, double drift_ = 0.0) : offset(offset_), drift(drift_) {}
  /// The model's clock when the record's shows t [s].
  double ModelTime(double t, double pivot) const {
    return drift == 0.0 ? t - offset : pivot + (t - pivot) / (1.0 + drift) - offset;
  }
};

/// "free", "known" (it is 0), "0.25" (it is known to be), "0.25+-0.001" (mean and standard
/// deviation). Throws Error, placed at `where`, for anything else.
Prior ParsePrior(const std::string& text, const std::string& where);
/// "free", "known" (the frames are one), "0.002,0.001": one but for a shift [m] and a rotation
/// [rad] of these standard deviations, each axis.
FramePrior ParseFramePrior(const std::string& text, const std::string& where);

}  // namespace unfurl::correlate
