#include "sim/effects/gravity.h"

#include <algorithm>

#include "base/loop.h"

namespace unfurl::sim {

Gravity::Gravity(const Array& mass, double gx, double gy)
    : mass_(mass),
      gx_(gx),
      gy_(gy),
      count_(static_cast<int>(
          std::count_if(mass.begin(), mass.end(), [](double m) { return m > 0.0; }))) {}

void Gravity::AddLoad(const Motion&, Load load, double*) const {
  const int n = static_cast<int>(mass_.size());
  double* __restrict fx = load.fx;
  double* __restrict fy = load.fy;
  UNFURL_INDEPENDENT
  for (int i = 0; i < n; ++i) {
    fx[i] += mass_[i] * gx_;
    fy[i] += mass_[i] * gy_;
  }
}

double Gravity::Energy(const Motion& motion) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < mass_.size(); ++i) {
    sum -= mass_[i] * (gx_ * motion.x[i] + gy_ * motion.y[i]);
  }
  return sum;
}

}  // namespace unfurl::sim
