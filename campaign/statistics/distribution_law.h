#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "campaign/statistics/distribution.h"

namespace unfurl::campaign {

/// What a distribution is made of. Probabilities are told from both ends, since 1 - p has lost what
/// is small.
class Distribution::Law {
 public:
  virtual ~Law() = default;
  virtual double Lower(double p) const = 0;                    // x with P(X <= x) = p
  virtual double Upper(double q) const = 0;                    // x with P(X > x) = q
  virtual double Below(double x) const = 0;                    // P(X <= x)
  virtual double Above(double x) const = 0;                    // P(X > x)
  virtual double Less(double x) const { return Below(x); }     // P(X < x)
  virtual double AtLeast(double x) const { return Above(x); }  // P(X >= x)
  virtual std::pair<double, double> Moments() const = 0;       // mean, standard deviation
  virtual std::string Words() const = 0;
  // Values of x where the quantile has a kink.
  virtual std::vector<double> Kinks() const { return {}; }
  // This law (`self`) given low <= x <= high; none where that holds nothing of it.
  virtual std::shared_ptr<const Law> Between(std::shared_ptr<const Law> self, double low,
                                             double high) const;
};

/// Laws of parameters that were checked.
using LawPointer = std::shared_ptr<const Distribution::Law>;
LawPointer MakeNormalLaw(double mean, double sigma);
LawPointer MakeUniformLaw(double low, double high);
LawPointer MakeLogNormalLaw(double median, double factor);
LawPointer MakeLogUniformLaw(double low, double high);
LawPointer MakeTriangularLaw(double low, double mode, double high);
/// Of values ascending and distinct, probabilities of sum 1.
LawPointer MakeTableLaw(std::vector<double> values, std::vector<double> probabilities);
/// Of samples ascending.
LawPointer MakeEmpiricalLaw(std::vector<double> sorted);

}  // namespace unfurl::campaign
