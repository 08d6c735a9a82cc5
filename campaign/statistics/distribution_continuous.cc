#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/probability.h"
#include "base/statistics.h"
#include "campaign/statistics/distribution_law.h"
#include "campaign/statistics/integrate.h"

namespace unfurl::campaign {

namespace {

using Law = Distribution::Law;
using Pair = std::pair<double, double>;

class NormalLaw : public Law {
 public:
  NormalLaw(double mean, double sigma) : mean_(mean), sigma_(sigma) {}
  double Lower(double p) const override { return mean_ + sigma_ * Score(p); }
  double Upper(double q) const override { return mean_ - sigma_ * Score(q); }
  double Below(double x) const override { return NormalCdf((x - mean_) / sigma_); }
  double Above(double x) const override { return NormalCdf((mean_ - x) / sigma_); }
  Pair Moments() const override { return {mean_, sigma_}; }
  std::string Words() const override {
    return fmt::format("normal, mean {:g}, sigma {:g}", mean_, sigma_);
  }

  static double Score(double p) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    if (p <= 0.0) return -kInfinity;
    return p >= 1.0 ? kInfinity : NormalQuantile(p);
  }

 private:
  double mean_, sigma_;
};

class LogNormalLaw : public Law {
 public:
  LogNormalLaw(double median, double factor)
      : median_(median), factor_(factor), log_(std::log(median), std::log(factor)) {}
  double Lower(double p) const override { return std::exp(log_.Lower(p)); }
  double Upper(double q) const override { return std::exp(log_.Upper(q)); }
  double Below(double x) const override { return x <= 0.0 ? 0.0 : log_.Below(std::log(x)); }
  double Above(double x) const override { return x <= 0.0 ? 1.0 : log_.Above(std::log(x)); }
  Pair Moments() const override {
    const double variance = std::log(factor_) * std::log(factor_);
    const double mean = median_ * std::exp(variance / 2.0);
    return {mean, mean * std::sqrt(std::expm1(variance))};
  }
  std::string Words() const override {
    return fmt::format("log-normal, median {:g}, factor {:g}", median_, factor_);
  }

 private:
  double median_, factor_;
  NormalLaw log_;
};

class UniformLaw : public Law {
 public:
  UniformLaw(double low, double high) : low_(low), high_(high) {}
  double Lower(double p) const override { return p >= 1.0 ? high_ : low_ + p * (high_ - low_); }
  double Upper(double q) const override { return q >= 1.0 ? low_ : high_ - q * (high_ - low_); }
  double Below(double x) const override {
    return std::clamp((x - low_) / (high_ - low_), 0.0, 1.0);
  }
  double Above(double x) const override {
    return std::clamp((high_ - x) / (high_ - low_), 0.0, 1.0);
  }
  Pair Moments() const override {
    return {low_ + (high_ - low_) / 2.0, (high_ - low_) / std::sqrt(12.0)};
  }
  std::string Words() const override { return fmt::format("uniform, {:g} to {:g}", low_, high_); }

 private:
  double low_, high_;
};

class LogUniformLaw : public Law {
 public:
  LogUniformLaw(double low, double high)
      : low_(low), high_(high), log_(std::log(low), std::log(high)) {}
  double Lower(double p) const override { return std::clamp(std::exp(log_.Lower(p)), low_, high_); }
  double Upper(double q) const override { return std::clamp(std::exp(log_.Upper(q)), low_, high_); }
  double Below(double x) const override { return x <= 0.0 ? 0.0 : log_.Below(std::log(x)); }
  double Above(double x) const override { return x <= 0.0 ? 1.0 : log_.Above(std::log(x)); }
  Pair Moments() const override {
    // With w = log(high / low) / 2: mean = g sinh(w) / w, where g is the geometric middle, and
    // variance = mean^2 (w / tanh(w) - 1), here by a series where w is small.
    const double w = (std::log(high_) - std::log(low_)) / 2.0;
    const double mean = std::exp((std::log(low_) + std::log(high_)) / 2.0) * std::sinh(w) / w;
    constexpr double kSmall = 0.01;  // the next term of the series is 1e-13 there
    const double excess = w < kSmall
                              ? w * w / 3.0 - w * w * w * w / 45.0 + 2.0 * std::pow(w, 6) / 945.0
                              : w / std::tanh(w) - 1.0;
    return {mean, mean * std::sqrt(excess)};
  }
  std::string Words() const override {
    return fmt::format("log-uniform, {:g} to {:g}", low_, high_);
  }

 private:
  double low_, high_;
  UniformLaw log_;
};

class TriangularLaw : public Law {
 public:
  TriangularLaw(double low, double mode, double high) : low_(low), mode_(mode), high_(high) {}
  double Lower(double p) const override {
    const double rise = (mode_ - low_) / (high_ - low_);
    return p <= rise ? low_ + std::sqrt(p * (high_ - low_) * (mode_ - low_))
                     : high_ - std::sqrt((1.0 - p) * (high_ - low_) * (high_ - mode_));
  }
  double Upper(double q) const override {
    const double fall = (high_ - mode_) / (high_ - low_);
    return q <= fall ? high_ - std::sqrt(q * (high_ - low_) * (high_ - mode_)) : Lower(1.0 - q);
  }
  double Below(double x) const override {
    if (x <= low_) return 0.0;
    if (x > mode_) return 1.0 - Above(x);
    return (x - low_) * (x - low_) / ((high_ - low_) * (mode_ - low_));
  }
  double Above(double x) const override {
    if (x >= high_) return 0.0;
    if (x <= mode_) return 1.0 - Below(x);
    return (high_ - x) * (high_ - x) / ((high_ - low_) * (high_ - mode_));
  }
  Pair Moments() const override {
    const double a = mode_ - low_, b = high_ - mode_;  // variance from differences: no cancelling
    return {low_ + (2.0 * a + b) / 3.0, std::sqrt((a * a + a * b + b * b) / 18.0)};
  }
  std::string Words() const override {
    return fmt::format("triangular, {:g} to {:g}, mode {:g}", low_, high_, mode_);
  }
  std::vector<double> Kinks() const override { return {mode_}; }

 private:
  double low_, mode_, high_;
};

// A continuous law between two values. Probabilities are taken from the nearer end, so that an
// interval far out in either tail keeps its digits.
class TruncatedLaw : public Law {
 public:
  TruncatedLaw(std::shared_ptr<const Law> whole, double low, double high)
      : whole_(std::move(whole)), low_(low), high_(high) {
    from_above_ = whole_->Below(low) > 0.5;
    first_ = from_above_ ? whole_->Above(low) : whole_->Below(low);
    mass_ = from_above_ ? first_ - whole_->Above(high) : whole_->Below(high) - first_;
    // What lies beyond `high`, for upper probabilities when the interval reaches into that tail.
    beyond_ = whole_->Above(high);
  }
  double mass() const { return mass_; }
  double Lower(double p) const override {
    if (p > 0.5 && !from_above_) return Upper(1.0 - p);
    return Clamp(from_above_ ? whole_->Upper(first_ - p * mass_)
                             : whole_->Lower(first_ + p * mass_));
  }
  double Upper(double q) const override {
    return Clamp(from_above_ || beyond_ + q * mass_ < 0.5
                     ? whole_->Upper(beyond_ + q * mass_)
                     : whole_->Lower(first_ + (1.0 - q) * mass_));
  }
  double Below(double x) const override {
    if (x < low_) return 0.0;
    if (x >= high_) return 1.0;
    const double p = from_above_ ? first_ - whole_->Above(x) : whole_->Below(x) - first_;
    return std::clamp(p / mass_, 0.0, 1.0);
  }
  double Above(double x) const override {
    if (x < low_) return 1.0;
    if (x >= high_) return 0.0;
    return std::clamp((whole_->Above(x) - beyond_) / mass_, 0.0, 1.0);
  }
  Pair Moments() const override {
    // Integrals of the quantile over the probability, from a middle so that nothing cancels.
    const double middle = Lower(0.5);
    std::vector<double> breaks = {0.0, 0.5, 1.0};
    for (double kink : whole_->Kinks()) breaks.push_back(Below(kink));
    std::sort(breaks.begin(), breaks.end());
    double first = 0.0, second = 0.0;
    for (std::size_t i = 1; i < breaks.size(); ++i) {
      const double a = breaks[i - 1], b = breaks[i];
      const auto at = [&](double from_a, double from_b) {
        return (from_a < from_b ? Lower(a + from_a) : Upper(1.0 - b + from_b)) - middle;
      };
      first += Integrate(a, b, at);
      second += Integrate(a, b, [&](double s, double t) { return at(s, t) * at(s, t); });
    }
    return {middle + first, std::sqrt(std::max(second - first * first, 0.0))};
  }
  std::string Words() const override {
    return fmt::format("{}, truncated to {:g} .. {:g}", whole_->Words(), low_, high_);
  }
  std::vector<double> Kinks() const override { return whole_->Kinks(); }

 private:
  double Clamp(double x) const { return std::clamp(x, low_, high_); }

  std::shared_ptr<const Law> whole_;
  double low_, high_;
  bool from_above_ = false;  // first_ is P(X > low), and not P(X <= low)
  double first_ = 0.0, mass_ = 0.0, beyond_ = 0.0;
};

}  // namespace

std::shared_ptr<const Law> Law::Between(std::shared_ptr<const Law> self, double low,
                                        double high) const {
  constexpr double kLeast = 1e-300;  // below it probabilities lose digits to underflow
  auto between = std::make_shared<TruncatedLaw>(std::move(self), low, high);
  return between->mass() > kLeast ? between : nullptr;
}

LawPointer MakeNormalLaw(double mean, double sigma) {
  return std::make_shared<NormalLaw>(mean, sigma);
}

LawPointer MakeUniformLaw(double low, double high) {
  return std::make_shared<UniformLaw>(low, high);
}

LawPointer MakeLogNormalLaw(double median, double factor) {
  return std::make_shared<LogNormalLaw>(median, factor);
}

LawPointer MakeLogUniformLaw(double low, double high) {
  return std::make_shared<LogUniformLaw>(low, high);
}

LawPointer MakeTriangularLaw(double low, double mode, double high) {
  return std::make_shared<TriangularLaw>(low, mode, high);
}

}  // namespace unfurl::campaign
