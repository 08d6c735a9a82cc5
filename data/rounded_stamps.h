#pragma once

#include <functional>
#include <vector>

namespace unfurl::data {

// The step of an even record that is written as `step`, known to within `rounding` of it [same
// unit]: where the reciprocal of a rate of few digits lies there, that, else the step itself. A
// hundredth of a stamp's last digit adds up to a clock that is wrong by parts in a million.
double UnroundedStep(double step, double rounding);

// Stamps that are an even grid but for the rounding of each, which `rounding` gives [same unit],
// are replaced by that grid.
void RestoreGrid(std::vector<double>* t, const std::function<double(double)>& rounding);

// The same of stamps written with as many decimals, nine at most.
void RestoreDecimals(std::vector<double>* t);

// Half of the last digit of a number in Fortran's E13.5, and of an IEEE number in 32 bits.
double RoundingOfE5(double value);
double RoundingOfFloat(double value);

}  // namespace unfurl::data
