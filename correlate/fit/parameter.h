#pragma once

#include <Eigen/Core>
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

// A step from u on, of which the slope d / d u at u tells. A logarithm's is taken by the value: v
// becomes v (1 + step), as a model answers nearly in proportion to what it can hardly be told from
// nothing of. Neither leaves the bounds, nor does a logarithm fall below a thousandth of v.
double StepByValue(const Parameter& parameter, double u, double step);
// The step by which StepByValue leads from u to `to`; of all parameters.
double ValueStep(const Parameter& parameter, double u, double to);
Eigen::VectorXd ValueSteps(const std::vector<Parameter>& parameters, const Eigen::VectorXd& u,
                           const Eigen::VectorXd& to);
// The lowest value that StepByValue leads to from u, as a step; and the highest.
double StepToLowest(const Parameter& parameter, double u);
double StepToHighest(const Parameter& parameter, double u);

// Where a search over the bounds begins: the lower one; of a logarithm that may come to nothing a
// thousandth of the start, which is nothing beside it.
double SearchLow(const Parameter& parameter);

// The same, where a logarithm's values are to stay what the step says however far it leads: below
// half of v along the hyperbola that goes on from there with the same slope, v / (-4 step).
double StepAsymptotic(const Parameter& parameter, double u, double step);
double AsymptoticStep(const Parameter& parameter, double u, double to);

// Distance beyond which a parameter is no longer called known: half of its value, or, where zero
// lies within its bounds, an eighth of their range, in its unit.
double KnownWithin(const Parameter& parameter, double value);

// Values from internal coordinates.
std::vector<double> Values(const std::vector<Parameter>& parameters, const double* u);

}  // namespace unfurl::correlate
