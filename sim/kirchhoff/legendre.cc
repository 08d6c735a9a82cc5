#include "sim/kirchhoff/legendre.h"

#include <cmath>

namespace unfurl::sim {

std::vector<double> Legendre(int n, double z) {
  std::vector<double> p(n + 1, 1.0);
  if (n >= 1) p[1] = z;
  for (int k = 2; k <= n; ++k) p[k] = ((2 * k - 1) * z * p[k - 1] - (k - 1) * p[k - 2]) / k;
  return p;
}

void GaussPoints(int n, Array* x, Array* weight) {
  x->resize(n);
  weight->resize(n);
  for (int i = 0; i < n; ++i) {
    double z = -std::cos(M_PI * (i + 0.75) / (n + 0.5)), slope = 1.0;
    constexpr int kIterations = 8;  // Newton's doubles the digits of a guess good to three
    for (int k = 0; k < kIterations; ++k) {
      const std::vector<double> p = Legendre(n, z);
      slope = n * (z * p[n] - p[n - 1]) / (z * z - 1.0);
      z -= p[n] / slope;
    }
    (*x)[i] = 0.5 * (1.0 + z);
    (*weight)[i] = 1.0 / ((1.0 - z * z) * slope * slope);
  }
}

}  // namespace unfurl::sim
