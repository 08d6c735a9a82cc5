#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "measure/lens/polynomial.h"

namespace unfurl::measure {

// An equidistant wide-angle lens with two odd terms in the angle of incidence a = atan(x),
//   u - u0 = f a + t_0 a^3 + t_1 a^5 + (what misalignment adds),
// as Kannala and Brandt (2006), eq. (6), with one image coordinate.
struct FisheyeLens {
  static constexpr data::LensModel kModel = data::LensModel::kFisheye;
  static constexpr std::array<Monomial, 11> kMonomials = {
      {{3, 0}, {5, 0}, {1, 2}, {2, 0}, {1, 1}, {0, 2}, {7, 0}, {3, 2}, {1, 4}, {2, 1}, {0, 3}}};
  // Those of the order that fits start from come first.
  static constexpr std::size_t kUsualTerms = 6, kUsualOrder = 2;
  // As in RectilinearLens; real lenses lie between stereographic and orthographic, which at 60
  // degrees differ from equidistant by 10 and 17%.
  static constexpr std::array<double, data::kLensTerms> kPrior = {
      0.1, 0.05, 0.05, 0.01, 0.01, 0.01, 0.02, 0.02, 0.02, 0.003, 0.003};
  static constexpr std::array<LensOrder, 4> kOrders = {{
      {"equidistant", {}},
      {"two-parameter", {true, true}},
      {"full", {true, true, true, true, true, true}},
      {"septic", {true, true, true, true, true, true, true, true, true, true, true}},
  }};

  template <std::size_t count = kMonomials.size()>
  [[gnu::always_inline]] static LensImage Evaluate(double x, double y, double f,
                                                   const double* terms) {
    LensImage out = EvaluatePolynomial<FisheyeLens, count>(std::atan(x), y, f, terms);
    out.du_dx /= 1.0 + x * x;  // da/dx
    return out;
  }
  static double Straighten(double image) {
    constexpr double kMost = 1.5;  // short of a right angle [rad]
    return std::tan(std::clamp(image, -kMost, kMost));
  }
  static constexpr bool kStraight = false;
};

}  // namespace unfurl::measure
