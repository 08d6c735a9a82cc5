#include "sim/effects/moment_table.h"

#include <algorithm>

#include "sim/effects/monotone_slopes.h"

namespace unfurl::sim {
MomentTable::MomentTable(const Record& record) : knots_(record.coordinate) {
  const std::vector<double>&points = record.coordinate, &moments = record.moment;
  const auto [least, most] = std::minmax_element(moments.begin(), moments.end());
  range_ = *most - *least;
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
