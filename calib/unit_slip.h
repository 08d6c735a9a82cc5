#pragma once

#include <string>
#include <vector>

namespace unfurl::calib {

/// Lengths written in one unit under the name of another.
struct UnitSlip {
  bool found = false;
  std::string what;     // "millimetres under the name of metres"
  std::string unit;     // the one to state: "mm"
  double factor = 1.0;  // what the lengths are to be multiplied by [-]
};

// Of the units that lengths are written in: millimetres, centimetres, inches, feet and micrometres
// for metres, and metres for each of them.
const std::vector<UnitSlip>& UnitSlips();

// Which of them makes lengths `times` as long as they are, to within the share `alike`.
UnitSlip FindUnitSlipOf(double times, double alike);

// What gave a calibration its scale, and its readers the unit.
enum class ScaleFrom { kSurvey, kBar, kBarWithPoints };
// "the coordinates are", "the stated length of the bar is"; and what to do about a wrong unit.
std::string UnitSubject(ScaleFrom from);
std::string UnitRemedy(ScaleFrom from, const UnitSlip& slip);

}  // namespace unfurl::calib
