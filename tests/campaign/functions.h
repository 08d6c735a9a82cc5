#pragma once

#include <cmath>
#include <functional>
#include <numbers>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "campaign/statistics/design.h"

namespace unfurl::campaign {

/// A function of the unit cube whose indices are known.
struct TestFunction {
  std::string name;
  int dimensions;
  std::function<double(std::span<const double>)> f;
  double mean, variance;
  std::vector<double> first, total;
};

inline void PrintTo(const TestFunction& f, std::ostream* out) { *out << f.name; }

/// sin x1 + 7 sin^2 x2 + 0.1 x3^4 sin x1 on (-pi, pi)^3 [Ishigami and Homma 1990].
inline TestFunction Ishigami() {
  using std::numbers::pi;
  const double a = 7.0, b = 0.1;
  const double v1 = 0.5 * std::pow(1 + b * std::pow(pi, 4) / 5, 2), v2 = a * a / 8;
  const double v13 = b * b * std::pow(pi, 8) * (1.0 / 18 - 1.0 / 50), v = v1 + v2 + v13;
  return {"ishigami",
          3,
          [=](std::span<const double> u) {
            const double x = pi * (2 * u[0] - 1), y = pi * (2 * u[1] - 1), z = pi * (2 * u[2] - 1);
            return std::sin(x) + a * std::pow(std::sin(y), 2) + b * std::pow(z, 4) * std::sin(x);
          },
          a / 2,
          v,
          {v1 / v, v2 / v, 0.0},
          {(v1 + v13) / v, v2 / v, v13 / v}};
}

/// The g-function prod (|4 u - 2| + a) / (1 + a) [Saltelli and Sobol' 1995].
inline TestFunction GFunction() {
  const std::vector<double> a = {0.0, 1.0, 4.5, 9.0, 99.0, 99.0};
  TestFunction g{"g_function", 6, {}, 1.0, 0.0, {}, {}};
  g.f = [a](std::span<const double> u) {
    double product = 1.0;
    for (std::size_t k = 0; k < 6; ++k) product *= (std::abs(4 * u[k] - 2) + a[k]) / (1 + a[k]);
    return product;
  };
  double all = 1.0;
  std::vector<double> v;
  for (double c : a) {
    v.push_back(1.0 / (3 * (1 + c) * (1 + c)));
    all *= 1 + v.back();
  }
  g.variance = all - 1.0;
  for (double x : v) {
    g.first.push_back(x / g.variance);
    g.total.push_back(x * all / (1 + x) / g.variance);
  }
  return g;
}

/// Values of a design's runs, in order.
inline std::vector<double> RunAll(const Design& design,
                                  const std::function<double(std::span<const double>)>& f) {
  std::vector<double> values, u(static_cast<std::size_t>(design.spec().dimensions));
  for (std::uint64_t i = 0; i < design.size(); ++i) {
    design.Point(i, u);
    values.push_back(f(u));
  }
  return values;
}

}  // namespace unfurl::campaign
