#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>

namespace unfurl::data {

// The lens models that a camera may have, as files name them. With (X, Y, Z) a point in the
// camera's frame, x = X / Z and y = Y / (Z + e), a model gives the reading
//   u = u0 + image(x, y; f, terms)   [px].
// The formulas stand in measure/lens/, a file for each.
enum class LensModel { kRectilinear, kFisheye };

// Terms of a model, at most; one with fewer leaves the rest at zero.
inline constexpr std::size_t kLensTerms = 22;

/// What files call a lens model and its terms.
struct LensNames {
  LensModel model;
  const char* name;
  std::array<const char*, kLensTerms> terms;  // what each coefficient multiplies; "": no such term
};

inline constexpr std::array<LensNames, 2> kLensModels = {{
    {LensModel::kRectilinear,
     "rectilinear",
     {"x^3",     "x y^2", "x^5", "x^3 y^2", "x y^4",   "x^2",   "x y", "y^2",
      "x^2 y",   "y^3",   "x^7", "x^5 y^2", "x^3 y^4", "x y^6", "x^4", "x^3 y",
      "x^2 y^2", "x y^3", "y^4", "x^4 y",   "x^2 y^3", "y^5"}},
    // With a = atan(x), the angle of incidence.
    {LensModel::kFisheye,
     "fisheye",
     {"a^3", "a^5", "a y^2", "a^2", "a y", "y^2", "a^7", "a^3 y^2", "a y^4", "a^2 y", "y^3",
      "",    "",    "",      "",    "",    "",    "",    "",        "",      "",      ""}},
}};

inline constexpr const LensNames& NamesOf(LensModel model) {
  return kLensModels[static_cast<std::size_t>(model)];
}

inline std::optional<LensModel> FindLensModel(std::string_view name) {
  for (const LensNames& lens : kLensModels) {
    if (name == lens.name) return lens.model;
  }
  return std::nullopt;
}

}  // namespace unfurl::data
