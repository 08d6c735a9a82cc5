#include "base/length.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "base/text.h"

namespace unfurl {

LengthUnit UnitFor(double metres) {
  constexpr double kShort = 0.95;  // below this many of a unit the next smaller one is taken
  constexpr std::array<LengthUnit, 4> kUnits = {
      {{"m", 1.0}, {"mm", 1e3}, {"um", 1e6}, {"nm", 1e9}}};
  const double size = std::abs(metres);
  // Millimetres down to a hundredth of one: what surveyors and structural engineers read.
  if (size * 1e3 < 1e3 * kShort && size * 1e3 >= 0.01) return kUnits[1];
  for (const LengthUnit& unit : kUnits) {
    if (size * unit.per_metre >= kShort) return unit;
  }
  return size > 0.0 ? kUnits[3] : kUnits[1];
}

std::string LengthText(double metres) {
  if (!std::isfinite(metres)) return "-";
  const LengthUnit unit = UnitFor(metres);
  return fmt::format("{:.3g} {}", unit.per_metre * metres, unit.name);
}

bool ParseLength(std::string_view text, double* metres) {
  constexpr std::array<LengthUnit, 7> kUnits = {{{"nm", 1e9},
                                                 {"um", 1e6},
                                                 {"mm", 1e3},
                                                 {"cm", 1e2},
                                                 {"m", 1.0},
                                                 {"ft", 1.0 / 0.3048},
                                                 {"in", 1.0 / 0.0254}}};
  text = Trim(text);
  double scale = 1.0;
  for (const LengthUnit& unit : kUnits) {
    const std::string_view name = unit.name;
    if (!text.ends_with(name)) continue;
    text.remove_suffix(name.size());
    scale = unit.per_metre;
    break;
  }
  double value = 0.0;
  if (!ParseDouble(Trim(text), &value) || !std::isfinite(value)) return false;
  *metres = value / scale;
  return true;
}

}  // namespace unfurl
