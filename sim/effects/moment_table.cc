#include "sim/effects/moment_table.h"

#include <algorithm>
#include <cmath>

namespace unfurl::sim {
namespace {

// Slopes at the points: the harmonic mean of the neighbouring chords, weighted by their lengths
// (Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5, 1984), zero where the chords turn; at the
// ends the parabola's, held to what keeps the piece monotone.
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

}  // namespace

MomentTable::MomentTable(const Record& record) {
  const std::vector<double>&points = record.coordinate, &moments = record.moment;
  const std::vector<double> slope = MonotoneSlopes(points, moments);
  double potential = 0.0;
  for (std::size_t k = 0; k + 1 < points.size(); ++k) {
    const double h = points[k + 1] - points[k], chord = (moments[k + 1] - moments[k]) / h;
    const Piece piece{points[k],
                      moments[k],
                      slope[k],
                      (3.0 * chord - 2.0 * slope[k] - slope[k + 1]) / h,
                      (slope[k] + slope[k + 1] - 2.0 * chord) / (h * h),
                      potential};
    potential -= h * (piece.c0 + h * (piece.c1 / 2.0 + h * (piece.c2 / 3.0 + h * piece.c3 / 4.0)));
    pieces_.push_back(piece);
  }
  pieces_.push_back({points.back(), moments.back(), slope.back(), 0.0, 0.0, potential});
}

MomentTable::Value MomentTable::At(double coordinate) const {
  const auto begin = pieces_.begin(), end = pieces_.end();
  const auto after = std::upper_bound(begin, end, coordinate,
                                      [](double q, const Piece& p) { return q < p.begin; });
  const Piece& p = *(after == begin ? begin : after - 1);
  const double s = coordinate - p.begin;
  if (after == begin) return {p.c0 + s * p.c1, p.c1, -s * (p.c0 + 0.5 * s * p.c1)};
  return {p.c0 + s * (p.c1 + s * (p.c2 + s * p.c3)), p.c1 + s * (2.0 * p.c2 + 3.0 * s * p.c3),
          p.potential - s * (p.c0 + s * (p.c1 / 2.0 + s * (p.c2 / 3.0 + s * p.c3 / 4.0)))};
}

}  // namespace unfurl::sim
