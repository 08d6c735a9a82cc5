#pragma once

#include <span>
#include <vector>

namespace unfurl::correlate {

// How alike two histories are, by the measures that test engineers publish. "Test" is the benchmark
// m, "computed" is c, both at the same stamps.
//
// Sprague and Geers and Russell compare energies, so they see where zero is: give what moves about
// a meaningful zero (displacements from rest, angles turned), not positions in somebody's frame.
struct SignalPair {
  std::span<const double> t;         // n, ascending [s]
  std::span<const double> test;      // n
  std::span<const double> computed;  // n
  std::span<const double> sigma;     // n, of their difference; empty: unknown
};

/// The measures, of one signal or of a vector.
struct SignalScore {
  std::size_t samples = 0;  // of one component
  double rmse = 0.0;        // root mean square of the distance [unit]
  double range = 0.0;  // of the test: largest less smallest value, components in quadrature [unit]
  double nrmse = 0.0;  // rmse / range [-]
  double r2 = 0.0;     // 1 - sum (m - c)^2 / sum (m - mean m)^2 [-]
  double largest = 0.0;     // distance [unit]
  double largest_at = 0.0;  // [s]
  double sigmas = 0.0;      // RMS of (m - c) / sigma; 0 without one [-]

  // [Sprague and Geers 2004]: with I_ab = integral of a b dt, magnitude sqrt(I_cc / I_mm) - 1,
  // phase acos(I_mc / sqrt(I_mm I_cc)) / pi, combined sqrt(M^2 + P^2).
  double sprague_geers_magnitude = 0.0, sprague_geers_phase = 0.0, sprague_geers = 0.0;
  // [Russell 1997]: with r = (I_cc - I_mm) / sqrt(I_cc I_mm), magnitude sign(r) log10(1 + |r|),
  // phase as above, comprehensive sqrt(pi / 4 (M^2 + P^2)). Up to 0.15 excellent, up to 0.28
  // acceptable.
  double russell_magnitude = 0.0, russell_phase = 0.0, russell = 0.0;
};

// One signal, or the components of a vector at the same stamps: sums and integrals run over all of
// them, and "distance" is the vector's. Integrals by the trapezoid rule; a gap (a step above 2.5
// median ones) is not integrated over. Throws Error for arrays of different lengths or fewer than
// two samples. A test without motion has r2 and nrmse of NaN.
SignalScore ScoreSignals(std::span<const SignalPair> components);

// Weights of the samples in such an integral [s].
std::vector<double> IntegralWeights(std::span<const double> t);

}  // namespace unfurl::correlate
