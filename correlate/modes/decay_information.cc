#include "correlate/modes/decay_information.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace unfurl::correlate {
namespace {

// With weights exp(-x u), u in [0, 1]: their sum times the variance of u. A change of frequency
// adds t times the sine's quadrature; what amplitude and phase can imitate of it is its mean.
double WeightedScatter(double x) {
  std::array<double, 3> moment = {};
  constexpr double kSeries = 1.0;  // |x| below which the closed form loses digits to cancellation
  if (std::abs(x) < kSeries) {
    constexpr int kTerms = 20;  // 1 / 20! is below rounding
    double power = 1.0;
    for (int k = 0; k < kTerms; ++k) {
      for (int n = 0; n < 3; ++n) moment[static_cast<std::size_t>(n)] += power / (n + k + 1);
      power *= -x / (k + 1);
    }
  } else {
    const double end = std::exp(-x);
    moment[0] = (1.0 - end) / x;
    moment[1] = (moment[0] - end) / x;
    moment[2] = (2.0 * moment[1] - end) / x;
  }
  return moment[2] - moment[1] * moment[1] / moment[0];
}

}  // namespace

double InformationShare(double decay, double window, double whole) {
  const double ratio = window / whole;
  const double share = ratio * ratio * ratio * WeightedScatter(2.0 * decay * window) /
                       WeightedScatter(2.0 * decay * whole);
  return std::clamp(share, 0.0, 1.0);
}

}  // namespace unfurl::correlate
