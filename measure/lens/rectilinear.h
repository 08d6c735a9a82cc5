#pragma once

#include <array>

#include "measure/lens/polynomial.h"

namespace unfurl::measure {

// u - u0 = f x + terms: the linear pinhole and what a cylinder lens and its misalignment add.
// [docs/physics-optics.md, the two-centre model]
struct RectilinearLens {
  static constexpr data::LensModel kModel = data::LensModel::kRectilinear;
  static constexpr std::array<Monomial, 22> kMonomials = {
      {{3, 0}, {1, 2}, {5, 0}, {3, 2}, {1, 4}, {2, 0}, {1, 1}, {0, 2}, {2, 1}, {0, 3}, {7, 0},
       {5, 2}, {3, 4}, {1, 6}, {4, 0}, {3, 1}, {2, 2}, {1, 3}, {0, 4}, {4, 1}, {2, 3}, {0, 5}}};
  // Those of the order that fits start from come first.
  static constexpr std::size_t kUsualTerms = 10, kUsualOrder = 5;
  // What is believed of each term before the readings speak: the standard deviation of what it
  // does at the edge of the field, as a share of the sensor's row [-]. Spherical aberration and
  // distortion of a plano-convex lens reach some 5% at third order; the even terms are made by
  // misalignment of slit and lens. What follows is about a third of the order before.
  static constexpr std::array<double, data::kLensTerms> kPrior = {
      0.07,  0.07,  0.02,  0.02,  0.02,  0.01,  0.01,  0.01,  0.01,  0.01,  0.006,
      0.006, 0.006, 0.006, 0.003, 0.003, 0.003, 0.003, 0.003, 0.003, 0.003, 0.003};
  static constexpr std::array<LensOrder, 7> kOrders = {{
      {"pinhole", {}},
      {"cubic", {true, true}},
      {"cubic-even", {true, true, false, false, false, true, true, true}},
      {"quintic", {true, true, true, true, true}},
      {"quintic-even", {true, true, true, true, true, true, true, true}},
      {"full", {true, true, true, true, true, true, true, true, true, true}},
      {"septic", {true, true, true, true, true, true, true, true, true, true, true,
                  true, true, true, true, true, true, true, true, true, true, true}},
  }};

  // Image and derivatives (measure/lens/polynomial.h); x, y [-], f [px].
  template <std::size_t count = kMonomials.size()>
  [[gnu::always_inline]] static LensImage Evaluate(double x, double y, double f,
                                                   const double* terms) {
    return EvaluatePolynomial<RectilinearLens, count>(x, y, f, terms);
  }
  // x of an ideal lens without terms from (u - u0) / f; the first guess is made with it.
  static double Straighten(double image) { return image; }
  static constexpr bool kStraight = true;  // Straighten does nothing
};

}  // namespace unfurl::measure
