#pragma once

#include <cstddef>

namespace unfurl {

/// P(X <= x) of a standard normal variable; accurate in the lower tail, the upper by -x.
double NormalCdf(double x);
/// P(K <= k) of the number of successes K in n trials of probability p, 0 <= p <= 1.
double BinomialCdf(std::size_t k, std::size_t n, double p);

}  // namespace unfurl
