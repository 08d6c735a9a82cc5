#pragma once

#include <limits>
#include <string>
#include <vector>

namespace unfurl::correlate {

// One unknown of a fit. The solver moves u: the value itself, or its logarithm.
struct Parameter {
  std::string name;
  std::string unit;
  double start = 0.0;                                     // [unit]
  double low = -std::numeric_limits<double>::infinity();  // [unit]
  double high = std::numeric_limits<double>::infinity();  // [unit]
  bool log = false;          // u = log(value); then value, bounds and start are > 0
  bool has_prior = false;    // what is known beforehand: a normal density in the value's unit
  double prior_mean = 0.0;   // [unit]
  double prior_sigma = 0.0;  // > 0 [unit]
};

// Throws Error, placed at parameter.NAME, for a start outside the bounds, bounds that do not
// enclose anything, a logarithm of what is not positive, a prior without a positive sigma.
void Check(const Parameter& parameter);

double ToInternal(const Parameter& parameter, double value);
double FromInternal(const Parameter& parameter, double u);
double Slope(const Parameter& parameter, double value);  // d value / d u

// Values from internal coordinates.
std::vector<double> Values(const std::vector<Parameter>& parameters, const double* u);

}  // namespace unfurl::correlate
