#pragma once

#include <Eigen/Core>
#include <complex>
#include <span>
#include <vector>

#include "correlate/modes/decay_fit.h"

namespace unfurl::correlate {

// Even stretches of several signals on one step, for methods that need shifts in time. Uneven
// stamps are interpolated within their stretch; a gap ends a stretch and is not bridged; longer
// steps come from a linear-phase low-pass filter, which leaves poles where they are. Each signal's
// trend is taken out, and each is weighted by its mean sigma.
struct EvenSignals {
  double step = 0.0;  // [s]
  double high = 0.0;  // what the filter lets pass [Hz]
  // Per signal, per stretch: values, and the first one's stamp after the earliest of all [s].
  struct Stretch {
    double start = 0.0;
    Eigen::VectorXd value;
  };
  std::vector<std::vector<Stretch>> signals;
};
EvenSignals OnEvenGrid(std::span<const DecaySignal> signals, int trend, double high);

// Poles s [1/s] of all signals together at the orders 2, 4, .. up to max_order, by the matrix
// pencil [Hua and Sarkar 1990] in the form that needs one symmetric eigenproblem: the windows of
// all signals and stretches are the rows of a Hankel matrix, whose row space is spanned by
// z_k^j; it is shifted by one column. Empty when no stretch is long enough.
struct PencilOrder {
  int order = 0;
  std::vector<std::complex<double>> poles;  // Im >= 0, those with Im > 0 standing for a pair
  std::vector<Eigen::VectorXcd> shapes;     // best amplitudes of each, one per signal
};
std::vector<PencilOrder> MatrixPencil(const EvenSignals& even, int max_order);

}  // namespace unfurl::correlate
