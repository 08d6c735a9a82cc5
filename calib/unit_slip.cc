#include "calib/unit_slip.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

namespace unfurl::calib {
namespace {

struct WrittenUnit {
  const char* plural;
  const char* name;  // as in a header
  double metres;
};
constexpr std::array<WrittenUnit, 5> kWrittenUnits = {{{"millimetres", "mm", 1e-3},
                                                       {"centimetres", "cm", 1e-2},
                                                       {"inches", "in", 0.0254},
                                                       {"feet", "ft", 0.3048},
                                                       {"micrometres", "um", 1e-6}}};

std::vector<UnitSlip> AllUnitSlips() {
  std::vector<UnitSlip> out;
  for (const WrittenUnit& unit : kWrittenUnits) {
    out.push_back(
        {true, fmt::format("{} under the name of metres", unit.plural), unit.name, unit.metres});
    out.push_back(
        {true, fmt::format("metres under the name of {}", unit.plural), "m", 1.0 / unit.metres});
  }
  return out;
}

}  // namespace

const std::vector<UnitSlip>& UnitSlips() {
  static const std::vector<UnitSlip> all = AllUnitSlips();
  return all;
}

UnitSlip FindUnitSlipOf(double times, double alike) {
  for (const UnitSlip& slip : UnitSlips()) {
    if (std::abs(times * slip.factor - 1.0) < alike) return slip;
  }
  return {};
}

std::string UnitSubject(ScaleFrom from) {
  return from == ScaleFrom::kSurvey ? "the coordinates are" : "the stated length of the bar is";
}

std::string UnitRemedy(ScaleFrom from, const UnitSlip& slip) {
  if (from == ScaleFrom::kSurvey) {
    return fmt::format("state the unit in the survey's header, as \"x [{}]\"", slip.unit);
  }
  return fmt::format("write the unit behind the bar's length, as \"--bar 30{0}+-0.1{0}\"",
                     slip.unit);
}

}  // namespace unfurl::calib
