#include "correlate/fit/parameter.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace unfurl::correlate {

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

std::vector<double> Values(const std::vector<Parameter>& parameters, const double* u) {
  std::vector<double> out(parameters.size());
  for (std::size_t j = 0; j < parameters.size(); ++j) out[j] = FromInternal(parameters[j], u[j]);
  return out;
}

}  // namespace unfurl::correlate
