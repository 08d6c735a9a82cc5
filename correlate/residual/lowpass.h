#pragma once

#include <Eigen/Core>

namespace unfurl::correlate {

/// The low pass of an instrument: what its anti-alias filter, or its averaging over a sampling
/// interval, does to what it measures.
struct LowPass {
  /// Which.
  enum class Kind {
    kNone,
    kButterworth,  ///< flattest amplitude; of order 1: an RC element
    kBessel,       ///< flattest delay
    kAverage,      ///< mean over `width` before the stamp
  };
  /// More than the filters of instruments have; the poles of a Bessel filter are exact to 1e-9
  /// there.
  static constexpr int kHighestOrder = 10;
  Kind kind = Kind::kNone;
  int order = 0;        ///< 1 to kHighestOrder, of the first two kinds
  double cutoff = 0.0;  ///< at which the amplitude is 1/sqrt(2), of the same [Hz]
  double width = 0.0;   ///< of an average [s]

  /// Throws Error naming the field.
  void Check() const;

  /// After which it has forgotten all but a thousandth of what was before [s].
  double Memory() const;

  /// What the instrument shows on an even grid of `step` [s] of the true values, n of any unit, it
  /// having shown the first of them for ever before. Exact for values that are linear between the
  /// points of the grid (state space, hold of first order); O(n).
  Eigen::VectorXd Apply(const Eigen::VectorXd& values, double step) const;
};

}  // namespace unfurl::correlate
