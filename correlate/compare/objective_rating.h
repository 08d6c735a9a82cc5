#pragma once

#include <span>
#include <utility>
#include <vector>

namespace unfurl::correlate {

// The objective rating of ISO/TS 18571 for two non-ambiguous histories, test T and computed C, on
// one even grid; all scores in [0, 1], 1 is best.
//
//   corridor   Z: mean over the samples of 1 within 0.05 max|T| of T, 0 beyond 0.5 max|T|, between
//              them ((outer - |T - C|) / (outer - inner))^2
//   phase      E_P: of the shift n of up to 0.2 N samples to either side that correlates best,
//              1 - |n| / (0.2 N)
//   magnitude  E_M: after that shift and dynamic time warping (squared differences, 10% band),
//              1 - eps / 0.5, eps = |C_w - T_w|_1 / |T_w|_1
//   slope      E_S: after that shift, of the derivatives averaged over nine samples,
//              1 - eps / 2, eps = |C' - T'|_1 / |T'|_1
//   overall    R = 0.4 Z + 0.2 E_P + 0.2 E_M + 0.2 E_S
//
// The standard samples at 10 kHz; nine samples then are 0.9 ms. At another rate the slope's average
// spans another time, which is said wherever the rating is shown.
enum class RatingGrade { kExcellent, kGood, kFair, kPoor };  // R above 0.94, 0.80, 0.58, or not
const char* Name(RatingGrade grade);

/// The four parts and the whole, 0 to 1 [-].
struct ObjectiveRating {
  double corridor = 0.0, phase = 0.0, magnitude = 0.0, slope = 0.0, overall = 0.0;  // [-]
  int shift = 0;  // samples by which C is behind T; negative: ahead
  RatingGrade grade = RatingGrade::kPoor;
};

// At least ten samples each, as many of both, or throws Error.
ObjectiveRating RateObjectively(std::span<const double> test, std::span<const double> computed);

RatingGrade GradeOf(double overall);

// The warping path of least summed squared differences within |i - j| <= band: pairs (index into x,
// index into y). Of equal costs the predecessor (i - 1, j) goes before (i, j - 1) before the
// diagonal, as the standard has it.
std::vector<std::pair<int, int>> WarpingPath(std::span<const double> x, std::span<const double> y,
                                             int band);

}  // namespace unfurl::correlate
