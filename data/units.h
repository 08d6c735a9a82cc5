#pragma once

#include <optional>
#include <string>

namespace unfurl::data {

/// How many of `unit` one `of` is: 1000 for "mm" of "m", 57.3 for "deg" of "rad". Nothing where
/// they do not measure the same, or one is not known. Equal texts are 1, whatever they are.
/// Known: s ms us min h; m mm um cm km in ft; rad mrad deg gon mgon arcsec rev; Hz; kg g;
/// N mN kN lbf; J; W; 1, % and um/m (strain); with products and quotients of them ("N m", "deg/s",
/// "m/s^2", "1/m"), rpm, and gn for the standard acceleration of gravity.
std::optional<double> UnitsPer(const std::string& unit, const std::string& of);

}  // namespace unfurl::data
