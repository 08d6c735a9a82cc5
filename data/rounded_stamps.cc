#include "data/rounded_stamps.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace unfurl::data {
namespace {

// A rate that a person sets has so many digits at most.
constexpr int kDigitsOfARate = 5;
// Stamps that are no grid look like one by chance where they are few, or their last digit is as
// coarse as what lies between them.
constexpr std::size_t kLeastStamps = 30;
constexpr double kMostOfAStep = 0.5;
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

namespace {

// Where a grid of this step begins, so that each stamp is within its rounding and the part `more`
// of it; false: nowhere.
bool Begins(const std::vector<double>& t, const std::function<double(double)>& rounding,
            double step, double more, double* start) {
  double low = -HUGE_VAL, high = HUGE_VAL, widest = 0.0;
  for (std::size_t i = 0; i < t.size(); ++i) {
    const double from = t[i] - step * static_cast<double>(i);
    const double within = rounding(t[i]) + kOfDoubles * std::fabs(t[i]);
    low = std::max(low, from - within);
    high = std::min(high, from + within);
    widest = std::max(widest, within);
  }
  // A first stamp of zero is meant so.
  const bool from_zero = t.front() == 0.0 && low <= 0.0 && high >= 0.0;
  *start = from_zero ? 0.0 : 0.5 * (low + high);
  return low <= high + more * widest;
}

// The step of the straight line through all stamps.
double LeastSquaresStep(const std::vector<double>& t) {
  const double middle = 0.5 * static_cast<double>(t.size() - 1);
  double over = 0.0, under = 0.0;
  for (std::size_t i = 0; i < t.size(); ++i) {
    const double at = static_cast<double>(i) - middle;
    over += at * (t[i] - t.front());
    under += at * at;
  }
  return over / under;
}

}  // namespace

void RestoreGrid(std::vector<double>* t, const std::function<double(double)>& rounding) {
  const std::size_t n = t->size();
  if (n < kLeastStamps) return;
  const double intervals = static_cast<double>(n - 1);
  const double mean = (t->back() - t->front()) / intervals;
  if (!(2.0 * std::max(rounding(t->front()), rounding(t->back())) <= kMostOfAStep * mean)) return;
  const double known = (rounding(t->front()) + rounding(t->back())) / intervals;
  double step = UnroundedStep(mean, known), start = 0.0;
  if (!Begins(*t, rounding, step, kSlack, &start)) {
    step = LeastSquaresStep(*t);
    // A line through n rounded stamps is off by some two deviations of one over the root of n.
    if (!Begins(*t, rounding, step, 4.0 / std::sqrt(static_cast<double>(n)), &start)) return;
  }
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
