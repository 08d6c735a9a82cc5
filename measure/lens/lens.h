#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "measure/lens/fisheye.h"
#include "measure/lens/polynomial.h"
#include "measure/lens/rectilinear.h"

namespace unfurl::measure {

// A point counts as in front of a camera where Z > kLeastSlope |X| and Z + e > kLeastSlope |Y|,
// that is up to 87 degrees from the optical axis: no lens sees further, and x and y stay finite.
inline constexpr double kLeastSlope = 0.05;  // [-]

// Every lens model, in the order of data::LensModel. A new one is a file like rectilinear.h, a line
// here and its names in data/lens.h (docs/extending.md).
template <typename... Lens>
struct LensList {
  static constexpr std::size_t kCount = sizeof...(Lens);

  // Calls `visit` with the type of the model's lens; gives what it returns.
  template <typename Visit>
  static auto With(data::LensModel model, const Visit& visit) {
    using Result = decltype(visit.template operator()<RectilinearLens>());
    if constexpr (std::is_void_v<Result>) {
      (void)((model == Lens::kModel ? (visit.template operator()<Lens>(), true) : false) || ...);
    } else {
      Result out{};
      (void)((model == Lens::kModel ? (out = visit.template operator()<Lens>(), true) : false) ||
             ...);
      return out;
    }
  }
  template <typename Visit>
  static void Each(const Visit& visit) {
    (visit.template operator()<Lens>(), ...);
  }
};
using Lenses = LensList<RectilinearLens, FisheyeLens>;
static_assert(Lenses::kCount == data::kLensModels.size());

// Of the model's orders the one that fits start from; those beyond it are tried where it does not
// fit.
inline int UsualOrderOf(data::LensModel model) {
  return Lenses::With(model, []<typename Lens>() { return static_cast<int>(Lens::kUsualOrder); });
}

// The image by any model.
inline LensImage EvaluateLens(data::LensModel model, double x, double y, double f,
                              const double* terms) {
  return Lenses::With(model, [&]<typename Lens>() { return Lens::Evaluate(x, y, f, terms); });
}

// What a calibration asks of a model: the sets of terms to choose from, the last of them whole; and
// the prior of each term (RectilinearLens::kPrior), 0 where there is none.
inline std::span<const LensOrder> OrdersOf(data::LensModel model) {
  return Lenses::With(model,
                      []<typename Lens>() { return std::span<const LensOrder>(Lens::kOrders); });
}
inline std::array<double, data::kLensTerms> PriorOf(data::LensModel model) {
  return Lenses::With(model, []<typename Lens>() { return Lens::kPrior; });
}

// Of its terms, those of the highest order: what the model breaks off with.
inline std::array<bool, data::kLensTerms> LastOrderOf(data::LensModel model) {
  return Lenses::With(model, []<typename Lens>() {
    std::array<bool, data::kLensTerms> out{};
    int highest = 0;
    for (const Monomial& m : Lens::kMonomials) highest = std::max(highest, m.x + m.y);
    for (std::size_t k = 0; k < Lens::kMonomials.size(); ++k) {
      out[k] = Lens::kMonomials[k].x + Lens::kMonomials[k].y == highest;
    }
    return out;
  });
}

// Whether the ideal lens is a pinhole, and x from its image (u - u0) / f.
inline bool IsStraight(data::LensModel model) {
  return Lenses::With(model, []<typename Lens>() { return Lens::kStraight; });
}
inline double Straighten(data::LensModel model, double image) {
  return Lenses::With(model, [&]<typename Lens>() { return Lens::Straighten(image); });
}

}  // namespace unfurl::measure
