#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "data/lens.h"

namespace unfurl::measure {

// What a lens makes of a point at (x, y), less the offset u0, with all its derivatives.
struct LensImage {
  double u_px = 0.0;                             // [px]
  double du_dx = 0.0, du_dy = 0.0;               // [px]
  double du_df = 0.0;                            // [-]
  std::array<double, data::kLensTerms> du_dt{};  // by the terms' coefficients [-]
};

// Powers of a lens' own two coordinates.
struct Monomial {
  int x, y;
};

// f x + sum_k t_k x^a_k y^b_k with its derivatives; `Lens::kMonomials` holds the powers, at most 7,
// of which the first `count` take part. Everything is known when it is compiled: no loop and no
// branch is left. Always inlined, for files with wider vectors share it.
template <typename Lens, std::size_t count>
[[gnu::always_inline]] inline LensImage EvaluatePolynomial(double x, double y, double f,
                                                           const double* t) {
  const double x2 = x * x, y2 = y * y;
  const double x3 = x2 * x, y3 = y2 * y;
  const double px[] = {1.0, x, x2, x3, x2 * x2, x2 * x3, x3 * x3, x3 * x3 * x};
  const double py[] = {1.0, y, y2, y3, y2 * y2, y2 * y3, y3 * y3, y3 * y3 * y};
  return [&]<std::size_t... k>(std::index_sequence<k...>) {
    constexpr auto& m = Lens::kMonomials;
    LensImage out;
    out.du_df = x;
    ((out.du_dt[k] = px[m[k].x] * py[m[k].y]), ...);
    out.u_px = f * x + (0.0 + ... + (t[k] * out.du_dt[k]));
    out.du_dx =
        f + (0.0 + ... +
             (m[k].x > 0 ? (m[k].x * t[k]) * (px[std::max(m[k].x - 1, 0)] * py[m[k].y]) : 0.0));
    out.du_dy = (0.0 + ... +
                 (m[k].y > 0 ? (m[k].y * t[k]) * (px[m[k].x] * py[std::max(m[k].y - 1, 0)]) : 0.0));
    return out;
  }
  (std::make_index_sequence<count>());
}

// A set of terms that a calibration may choose, by name.
struct LensOrder {
  const char* name;
  std::array<bool, data::kLensTerms> terms;  // in the order of data::LensNames::terms
};

}  // namespace unfurl::measure
