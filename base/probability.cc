#include "base/probability.h"

#include <boost/math/special_functions/beta.hpp>
#include <cmath>
#include <numbers>

namespace unfurl {

double NormalCdf(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

double BinomialCdf(std::size_t k, std::size_t n, double p) {
  if (k >= n || p <= 0.0) return 1.0;
  if (p >= 1.0) return 0.0;
  // The regularised incomplete beta function I_(1-p)(n - k, k + 1).
  return boost::math::ibetac(static_cast<double>(k + 1), static_cast<double>(n - k), p);
}

}  // namespace unfurl
