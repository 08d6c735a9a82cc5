#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "campaign/statistics/distribution_law.h"

namespace unfurl::campaign {

namespace {

using Law = Distribution::Law;
using Pair = std::pair<double, double>;

class TableLaw : public Law {
 public:
  // Values ascending and distinct, probabilities of sum 1.
  TableLaw(std::vector<double> values, std::vector<double> probabilities)
      : values_(std::move(values)), p_(std::move(probabilities)), below_(p_.size()) {
    std::partial_sum(p_.begin(), p_.end(), below_.begin());
    below_.back() = 1.0;
  }
  double Lower(double p) const override {
    const auto at = std::lower_bound(below_.begin(), below_.end(), p);
    return values_[std::min<std::size_t>(at - below_.begin(), values_.size() - 1)];
  }
  double Upper(double q) const override { return Lower(1.0 - q); }
  double Below(double x) const override {
    const auto n = std::upper_bound(values_.begin(), values_.end(), x) - values_.begin();
    return n == 0 ? 0.0 : below_[static_cast<std::size_t>(n - 1)];
  }
  double Above(double x) const override { return 1.0 - Below(x); }
  Pair Moments() const override {
    double mean = 0.0, variance = 0.0;
    for (std::size_t i = 0; i < p_.size(); ++i) mean += p_[i] * values_[i];
    for (std::size_t i = 0; i < p_.size(); ++i) {
      variance += p_[i] * (values_[i] - mean) * (values_[i] - mean);
    }
    return {mean, std::sqrt(variance)};
  }
  std::string Words() const override {
    constexpr std::size_t kListed = 5;  // more would be a list, not a sentence
    if (values_.size() > kListed) {
      return fmt::format("table of {} values, {:g} to {:g}", values_.size(), values_.front(),
                         values_.back());
    }
    std::string words = "table:";
    for (std::size_t i = 0; i < values_.size(); ++i) {
      words += fmt::format("{} {:g} ({:.3g})", i == 0 ? "" : ",", values_[i], p_[i]);
    }
    return words;
  }
  std::shared_ptr<const Law> Between(std::shared_ptr<const Law> /*self*/, double low,
                                     double high) const override {
    std::vector<double> values, p;
    for (std::size_t i = 0; i < values_.size(); ++i) {
      if (values_[i] < low || values_[i] > high) continue;
      values.push_back(values_[i]);
      p.push_back(p_[i]);
    }
    const double sum = std::accumulate(p.begin(), p.end(), 0.0);
    if (!(sum > 0.0)) return nullptr;
    for (double& v : p) v /= sum;
    return std::make_shared<TableLaw>(std::move(values), std::move(p));
  }

 private:
  std::vector<double> values_, p_, below_;
};

class EmpiricalLaw : public Law {
 public:
  // The quantile passes through (u, x), linear between; both ascend, u from 0 to 1.
  EmpiricalLaw(std::vector<double> u, std::vector<double> x, std::size_t samples)
      : u_(std::move(u)), x_(std::move(x)), samples_(samples) {}
  double Lower(double p) const override { return Interpolate(u_, x_, p); }
  double Upper(double q) const override { return Lower(1.0 - q); }
  double Below(double x) const override {
    if (x < x_.front()) return 0.0;
    const auto above = std::upper_bound(x_.begin(), x_.end(), x);
    if (above == x_.end()) return 1.0;
    return Line(x_, u_, static_cast<std::size_t>(above - x_.begin()), x);
  }
  double Less(double x) const override {
    if (x > x_.back()) return 1.0;
    const auto at = std::lower_bound(x_.begin(), x_.end(), x);
    if (at == x_.begin()) return 0.0;
    return Line(x_, u_, static_cast<std::size_t>(at - x_.begin()), x);
  }
  double Above(double x) const override { return 1.0 - Below(x); }
  double AtLeast(double x) const override { return 1.0 - Less(x); }
  Pair Moments() const override {  // of a mixture of uniform pieces
    double mean = 0.0, variance = 0.0;
    for (std::size_t i = 1; i < x_.size(); ++i) {
      mean += (u_[i] - u_[i - 1]) * (x_[i] + x_[i - 1]) / 2.0;
    }
    for (std::size_t i = 1; i < x_.size(); ++i) {
      const double a = x_[i - 1] - mean, b = x_[i] - mean;
      variance += (u_[i] - u_[i - 1]) * (a * a + a * b + b * b) / 3.0;
    }
    return {x_.size() == 1 ? x_[0] : mean, std::sqrt(variance)};
  }
  std::string Words() const override {
    return fmt::format("as {} samples, {:g} to {:g}", samples_, x_.front(), x_.back());
  }
  std::shared_ptr<const Law> Between(std::shared_ptr<const Law> /*self*/, double low,
                                     double high) const override {
    const double first = Less(low), last = Below(high);
    if (!(last > first)) return nullptr;
    std::vector<double> u = {0.0}, x = {Lower(first)};
    for (std::size_t i = 0; i < u_.size(); ++i) {
      if (u_[i] <= first || u_[i] >= last) continue;
      u.push_back((u_[i] - first) / (last - first));
      x.push_back(x_[i]);
    }
    u.push_back(1.0);
    x.push_back(Lower(last));
    return std::make_shared<EmpiricalLaw>(std::move(u), std::move(x), samples_);
  }

 private:
  // The line through points i - 1 and i, at a.
  static double Line(const std::vector<double>& a, const std::vector<double>& b, std::size_t i,
                     double at) {
    const double t = (at - a[i - 1]) / (a[i] - a[i - 1]);
    return b[i - 1] + t * (b[i] - b[i - 1]);
  }
  static double Interpolate(const std::vector<double>& a, const std::vector<double>& b, double at) {
    if (at <= a.front() || a.size() == 1) return b.front();
    if (at >= a.back()) return b.back();
    return Line(a, b,
                static_cast<std::size_t>(std::upper_bound(a.begin(), a.end(), at) - a.begin()), at);
  }

  std::vector<double> u_, x_;
  std::size_t samples_;
};

}  // namespace

LawPointer MakeTableLaw(std::vector<double> values, std::vector<double> probabilities) {
  return std::make_shared<TableLaw>(std::move(values), std::move(probabilities));
}

LawPointer MakeEmpiricalLaw(std::vector<double> sorted) {
  const std::size_t n = sorted.size();
  std::vector<double> u(n);
  for (std::size_t i = 1; i < n; ++i) u[i] = static_cast<double>(i) / static_cast<double>(n - 1);
  return std::make_shared<EmpiricalLaw>(std::move(u), std::move(sorted), n);
}

}  // namespace unfurl::campaign
