#include "sim/sparse_ldlt.h"

namespace unfurl::sim {

void SparseLdlt::FactorAndForward(double* diagonal, double* off, double* inverse, double* x) const {
  const int steps = size();
  const int* place = place_.data();
  const int* row = row_.data();
  const int* target = target_.data();
  for (int k = 0; k < steps; ++k) {
    const int r = order_[k];
    const double pivot_inverse = 1.0 / diagonal[r];
    const double xr = x[r];
    inverse[r] = pivot_inverse;
    x[r] = xr * pivot_inverse;
    const int end = begin_[k + 1];
    for (int a = begin_[k]; a < end; ++a) {
      const double v = off[place[a]];
      const double l = v * pivot_inverse;
      diagonal[row[a]] -= l * v;
      x[row[a]] -= l * xr;
      for (int b = a + 1; b < end; ++b) off[*target++] -= l * off[place[b]];
      off[place[a]] = l;
    }
  }
}

void SparseLdlt::Forward(const double* off, const double* inverse, double* x) const {
  const int steps = size();
  for (int k = 0; k < steps; ++k) {
    const int r = order_[k];
    const double xr = x[r];
    for (int a = begin_[k]; a < begin_[k + 1]; ++a) x[row_[a]] -= off[place_[a]] * xr;
    x[r] = xr * inverse[r];
  }
}

void SparseLdlt::Backward(const double* off, double* x) const {
  for (int k = size() - 1; k >= 0; --k) {
    double xr = x[order_[k]];
    for (int a = begin_[k]; a < begin_[k + 1]; ++a) xr -= off[place_[a]] * x[row_[a]];
    x[order_[k]] = xr;
  }
}

}  // namespace unfurl::sim
