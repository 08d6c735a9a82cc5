#include "data/rounded_stamps.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace unfurl::data {
namespace {

// A rate that a person sets has so many digits at most.
constexpr int kDigitsOfARate = 5;
// Beyond its rounding; and what sums and products of doubles may lose of a stamp.
constexpr double kSlack = 1e-6, kOfDoubles = 1e-14;

}  // namespace

double UnroundedStep(double step, double rounding) {
  if (!(step > 0.0) || !(rounding > 0.0)) return step;
  // The fewest digits first, of the step as of its rate.
  const auto rounded = [](double value, int digits) {
    const double unit = std::pow(10.0, digits - 1 - std::floor(std::log10(value)));
    return std::round(value * unit) / unit;
  };
  for (int digits = 1; digits <= kDigitsOfARate; ++digits) {
    for (const double found : {rounded(step, digits), 1.0 / rounded(1.0 / step, digits)}) {
      if (std::fabs(found - step) <= (1.0 + kSlack) * rounding) return found;
    }
  }
  return step;
}

void RestoreGrid(std::vector<double>* t, const std::function<double(double)>& rounding) {
  const std::size_t n = t->size();
  if (n < 3) return;
  const double first = t->front(), last = t->back();
  const double intervals = static_cast<double>(n - 1);
  const double step =
      UnroundedStep((last - first) / intervals, (rounding(first) + rounding(last)) / intervals);
  double low = -HUGE_VAL, high = HUGE_VAL;  // of the grid's start, by each stamp
  for (std::size_t i = 0; i < n; ++i) {
    const double from = (*t)[i] - step * static_cast<double>(i);
    const double within = rounding((*t)[i]) + kOfDoubles * std::fabs((*t)[i]);
    low = std::max(low, from - within);
    high = std::min(high, from + within);
  }
  if (!(low <= high)) return;
  // A first stamp of zero is meant so.
  const double start = first == 0.0 && low <= 0.0 && high >= 0.0 ? 0.0 : 0.5 * (low + high);
  for (std::size_t i = 0; i < n; ++i) (*t)[i] = start + step * static_cast<double>(i);
}

void RestoreDecimals(std::vector<double>* t) {
  constexpr int kMostDecimals = 9;  // nanoseconds of a stamp in seconds
  double unit = 1.0;
  for (int decimals = 0; decimals <= kMostDecimals; ++decimals, unit *= 10.0) {
    const bool all = std::all_of(t->begin(), t->end(), [unit](double x) {
      return std::fabs(x * unit - std::round(x * unit)) <= kSlack;
    });
    if (all) return RestoreGrid(t, [unit](double) { return 0.5 / unit; });
  }
}

double RoundingOfE5(double value) {
  if (value == 0.0) return 0.0;
  return 0.5 * std::pow(10.0, std::floor(std::log10(std::fabs(value))) - 5.0);
}

double RoundingOfFloat(double value) {
  return 0.5 * std::numeric_limits<float>::epsilon() * std::fabs(value);
}

}  // namespace unfurl::data
