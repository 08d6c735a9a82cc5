#pragma once

#include <memory>
#include <string>

#include "data/expression.h"
#include "data/function_scan.h"
#include "data/time_function.h"

namespace unfurl::data {

// What a TimeFunction may be.
struct TimeFunction::Impl {
  virtual ~Impl() = default;
  virtual TimeValue At(double t) const = 0;
  virtual double Value(double t) const { return At(t).value; }
  virtual bool is_constant() const { return false; }
  virtual std::shared_ptr<const Impl> Integral(double start, double duration) const = 0;
  virtual std::optional<unfurl::data::Expression::Fault> FindFault(double, int, int) const {
    return std::nullopt;
  }
  virtual std::vector<double> Edges(double) const { return {}; }
  virtual std::optional<TimeFunction::Bounds> Bound(double, double, int) const {
    return std::nullopt;
  }
  FunctionScan Scan(int derivative, double duration, double part, std::size_t most) const;
  virtual std::string text() const = 0;  // as written, or what it is
  std::string where;
};

// The integral of a smooth function, as Chebyshev series on as many pieces as they need
// (time_integral.cc). Throws Error with `where` and `text`.
std::shared_ptr<const TimeFunction::Impl> IntegrateSmooth(
    const std::shared_ptr<const TimeFunction::Impl>& rate, double start, double duration);

}  // namespace unfurl::data
