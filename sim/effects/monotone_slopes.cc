#include "sim/effects/monotone_slopes.h"

#include <cmath>

namespace unfurl::sim {

// The harmonic mean of the neighbouring chords, weighted by their lengths (Fritsch and Butland,
// SIAM J. Sci. Stat. Comput. 5, 1984), zero where the chords turn; at the ends the parabola's, held
// to what keeps the piece monotone.
std::vector<double> MonotoneSlopes(const std::vector<double>& x, const std::vector<double>& y) {
  const std::size_t n = x.size();
  std::vector<double> h(n - 1), chord(n - 1), slope(n);
  for (std::size_t k = 0; k + 1 < n; ++k) {
    h[k] = x[k + 1] - x[k];
    chord[k] = (y[k + 1] - y[k]) / h[k];
  }
  if (n == 2) return {chord[0], chord[0]};
  for (std::size_t k = 1; k + 1 < n; ++k) {
    if (chord[k - 1] * chord[k] <= 0.0) continue;
    const double w0 = 2.0 * h[k] + h[k - 1], w1 = h[k] + 2.0 * h[k - 1];
    slope[k] = (w0 + w1) / (w0 / chord[k - 1] + w1 / chord[k]);
  }
  const auto end = [](double h0, double h1, double chord0, double chord1) {
    const double s = ((2.0 * h0 + h1) * chord0 - h0 * chord1) / (h0 + h1);
    if (s * chord0 <= 0.0) return 0.0;
    if (chord0 * chord1 <= 0.0 && std::fabs(s) > 3.0 * std::fabs(chord0)) return 3.0 * chord0;
    return s;
  };
  slope[0] = end(h[0], h[1], chord[0], chord[1]);
  slope[n - 1] = end(h[n - 2], h[n - 3], chord[n - 2], chord[n - 3]);
  return slope;
}

}  // namespace unfurl::sim
