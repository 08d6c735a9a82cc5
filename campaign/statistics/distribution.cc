#include "campaign/statistics/distribution.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "base/error.h"
#include "campaign/statistics/distribution_law.h"

namespace unfurl::campaign {

namespace {

[[noreturn]] void Refuse(const std::string& what, const std::string& remedy) {
  throw Error(what, "", remedy);
}

void WantFinite(const char* kind, std::initializer_list<double> values) {
  for (double v : values) {
    if (!std::isfinite(v)) {
      Refuse(fmt::format("a {} distribution with the parameter {}", kind, v),
             "give finite numbers");
    }
  }
}

}  // namespace

Distribution Distribution::Normal(double mean, double sigma) {
  WantFinite("normal", {mean, sigma});
  if (!(sigma > 0.0)) {
    Refuse(fmt::format("a normal distribution with sigma {:g}", sigma), "sigma is above zero");
  }
  return Distribution(MakeNormalLaw(mean, sigma));
}

Distribution Distribution::Uniform(double low, double high) {
  WantFinite("uniform", {low, high, high - low});
  if (!(low < high)) {
    Refuse(fmt::format("a uniform distribution from {:g} to {:g}", low, high),
           "the first bound is below the second");
  }
  return Distribution(MakeUniformLaw(low, high));
}

Distribution Distribution::LogNormal(double median, double factor) {
  WantFinite("log-normal", {median, factor});
  if (!(median > 0.0 && factor > 1.0)) {
    Refuse(fmt::format("a log-normal distribution with median {:g}, factor {:g}", median, factor),
           "the median is above 0 and the factor above 1");
  }
  return Distribution(MakeLogNormalLaw(median, factor));
}

Distribution Distribution::LogUniform(double low, double high) {
  WantFinite("log-uniform", {low, high});
  if (!(0.0 < low && low < high)) {
    Refuse(fmt::format("a log-uniform distribution from {:g} to {:g}", low, high),
           "both bounds are above zero, the first below the second");
  }
  return Distribution(MakeLogUniformLaw(low, high));
}

Distribution Distribution::Triangular(double low, double mode, double high) {
  WantFinite("triangular", {low, mode, high, high - low});
  if (!(low <= mode && mode <= high && low < high)) {
    Refuse(fmt::format("a triangular distribution from {:g} over {:g} to {:g}", low, mode, high),
           "the mode lies between the bounds, and these differ");
  }
  return Distribution(MakeTriangularLaw(low, mode, high));
}

Distribution Distribution::Table(std::vector<double> values, std::vector<double> weights) {
  if (values.empty()) Refuse("a table without values", "give one value or more");
  if (weights.empty()) weights.assign(values.size(), 1.0);
  if (weights.size() != values.size()) {
    Refuse(fmt::format("a table of {} values with {} weights", values.size(), weights.size()),
           "give each value a weight");
  }
  double sum = 0.0;
  std::vector<std::pair<double, double>> rows;
  for (std::size_t i = 0; i < values.size(); ++i) {
    WantFinite("table", {values[i], weights[i]});
    if (weights[i] < 0.0) {
      Refuse(fmt::format("the weight {:g} in a table", weights[i]), "weights are not negative");
    }
    sum += weights[i];
    if (weights[i] > 0.0) rows.emplace_back(values[i], weights[i]);
  }
  if (!(sum > 0.0) || !std::isfinite(sum)) {
    Refuse(fmt::format("weights of a table that add up to {:g}", sum), "give one above zero");
  }
  std::sort(rows.begin(), rows.end());
  std::vector<double> x, p;
  for (const auto& [value, weight] : rows) {
    if (x.empty() || x.back() != value) {
      x.push_back(value);
      p.push_back(0.0);
    }
    p.back() += weight / sum;
  }
  return Distribution(MakeTableLaw(std::move(x), std::move(p)));
}

Distribution Distribution::Empirical(std::vector<double> samples) {
  if (samples.empty()) Refuse("an empirical distribution of no samples", "give one or more");
  for (double x : samples) WantFinite("empirical", {x});
  std::sort(samples.begin(), samples.end());
  return Distribution(MakeEmpiricalLaw(std::move(samples)));
}

Distribution Distribution::Truncated(double low, double high) const {
  if (!(low < high)) {
    Refuse(fmt::format("a distribution truncated to {:g} .. {:g}", low, high),
           "the first bound is below the second");
  }
  LawPointer law = law_->Between(law_, low, high);
  if (law == nullptr) {
    Refuse(fmt::format("{:g} .. {:g} holds nothing of the distribution ({})", low, high, Words()),
           "widen the bounds of the truncation");
  }
  return Distribution(std::move(law));
}

double Distribution::Quantile(double u) const {
  if (!(u >= 0.0 && u <= 1.0)) {
    Refuse(fmt::format("the quantile at {:g}", u), "probabilities are between 0 and 1");
  }
  const double x = law_->Lower(u);
  if (!std::isfinite(x)) {
    Refuse(fmt::format("the quantile at {:g} of a distribution without that end ({})", u, Words()),
           "truncate it, or take a probability inside (0, 1)");
  }
  return x;
}

double Distribution::Cdf(double x) const { return law_->Below(x); }
double Distribution::Mean() const { return law_->Moments().first; }
double Distribution::Sigma() const { return law_->Moments().second; }
std::string Distribution::Words() const { return law_->Words(); }

}  // namespace unfurl::campaign
