#include "correlate/fit/parameter.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace unfurl::correlate {

namespace {
constexpr double kNothing = 1e-3;  // of a value whose logarithm is moved
}

void Check(const Parameter& p) {
  const std::string where = "parameter." + p.name;
  if (!(p.low < p.high)) {
    throw Error(fmt::format("the bounds {} and {} enclose nothing", p.low, p.high), where,
                "give bounds = [low, high] with low < high");
  }
  if (!(p.start >= p.low && p.start <= p.high)) {
    throw Error(
        fmt::format("the start {} lies outside the bounds [{}, {}]", p.start, p.low, p.high), where,
        "start within the bounds");
  }
  if (p.start == 0.0 && !std::isfinite(p.high - p.low) && !(p.has_prior && p.prior_sigma > 0.0)) {
    throw Error("a start of 0 without bounds says nothing of the size that the value may have",
                where, "give bounds = [low, high], or a prior with its sigma");
  }
  if (p.log && (!(p.start > 0.0) || p.low < 0.0)) {
    throw Error(fmt::format("a logarithm needs positive values, not start {} and lower bound {}",
                            p.start, p.low),
                where, "give a positive start and lower bound, or transform = \"none\"");
  }
  if (p.has_prior && !(p.prior_sigma > 0.0)) {
    throw Error(fmt::format("a prior with sigma {}", p.prior_sigma), where,
                "give a positive sigma, or no prior");
  }
}

double ToInternal(const Parameter& p, double value) { return p.log ? std::log(value) : value; }

double FromInternal(const Parameter& p, double u) {
  // Within the bounds to the last bit, whatever exp rounds to.
  return std::clamp(p.log ? std::exp(u) : u, p.low, p.high);
}

double Slope(const Parameter& p, double value) { return p.log ? value : 1.0; }

double StepByValue(const Parameter& p, double u, double step) {
  if (!p.log) return std::clamp(u + step, p.low, p.high);
  const double least = std::log1p(StepToLowest(p, u)), most = std::log1p(StepToHighest(p, u));
  return u + (step > -1.0 ? std::clamp(std::log1p(step), least, most) : least);
}

double ValueStep(const Parameter& p, double u, double to) {
  return p.log ? std::expm1(to - u) : to - u;
}

Eigen::VectorXd ValueSteps(const std::vector<Parameter>& parameters, const Eigen::VectorXd& u,
                           const Eigen::VectorXd& to) {
  Eigen::VectorXd out(u.size());
  for (Eigen::Index j = 0; j < u.size(); ++j) {
    out(j) = ValueStep(parameters[static_cast<std::size_t>(j)], u(j), to(j));
  }
  return out;
}

double SearchLow(const Parameter& p) {
  return p.log && !(p.low > 0.0) ? kNothing * p.start : p.low;
}

double StepToLowest(const Parameter& p, double u) {
  // Where a step leads to nothing, v is not many standard errors from 0, and this a few thousandths
  // of one.
  if (!p.log) return std::min(0.0, p.low - u);
  return std::min(0.0, std::max(p.low * std::exp(-u), kNothing) - 1.0);
}

double StepToHighest(const Parameter& p, double u) {
  return std::max(0.0, p.log ? p.high * std::exp(-u) - 1.0 : p.high - u);
}

namespace {
constexpr double kHyperbola = 0.5;  // of v, where 1 + step meets 1 / (-4 step) with one slope
}

double StepAsymptotic(const Parameter& p, double u, double step) {
  if (!p.log) return u + step;
  return u + (step >= -kHyperbola ? std::log1p(step) : -std::log(-4.0 * step));
}

double AsymptoticStep(const Parameter& p, double u, double to) {
  if (!p.log) return to - u;
  const double part = std::exp(to - u);
  return part >= kHyperbola ? part - 1.0 : -0.25 / part;
}

double KnownWithin(const Parameter& parameter, double value) {
  // A value is known to no better than its order of magnitude beyond half of itself; an eighth of
  // the range to either side is a quarter of what the bounds alone say.
  constexpr double kHalf = 0.5, kEighth = 0.125;
  const double range = parameter.high - parameter.low;
  if (parameter.low < 0.0 && parameter.high > 0.0 && std::isfinite(range)) {
    return std::max(kHalf * std::abs(value), kEighth * range);
  }
  return kHalf * std::abs(value);
}

std::vector<double> Values(const std::vector<Parameter>& parameters, const double* u) {
  std::vector<double> out(parameters.size());
  for (std::size_t j = 0; j < parameters.size(); ++j) out[j] = FromInternal(parameters[j], u[j]);
  return out;
}

}  // namespace unfurl::correlate
