#include "sim/constraints/sparse_ldlt.h"

namespace unfurl::sim {

void SparseLdlt::FactorAndForward(double* diagonal, double* off, double* inverse, double* x) const {
  const Entry* entry = entries_.data();
  const int* target = target_.data();
  for (const Step& step : steps_) {
    const int r = step.row;
    const double pivot_inverse = 1.0 / diagonal[r];
    const double xr = x[r];
    inverse[r] = pivot_inverse;
    x[r] = xr * pivot_inverse;
    if (step.count == 1) {
      // Along a chain the next pivot waits for this one: keep the way from one to the next short.
      const double v = off[entry->place];
      const double l = v * pivot_inverse;
      diagonal[entry->row] -= (v * v) * pivot_inverse;
      x[entry->row] -= (v * xr) * pivot_inverse;
      off[entry->place] = l;
      ++entry;
      continue;
    }
    const Entry* end = entry + step.count;
    for (const Entry* a = entry; a < end; ++a) {
      const double v = off[a->place];
      const double l = v * pivot_inverse;
      diagonal[a->row] -= l * v;
      x[a->row] -= l * xr;
      for (const Entry* b = a + 1; b < end; ++b) off[*target++] -= l * off[b->place];
      off[a->place] = l;
    }
    entry = end;
  }
}

void SparseLdlt::Forward(const double* off, const double* inverse, double* x) const {
  const Entry* entry = entries_.data();
  for (const Step& step : steps_) {
    const double xr = x[step.row];
    for (int k = 0; k < step.count; ++k, ++entry) x[entry->row] -= off[entry->place] * xr;
    x[step.row] = xr * inverse[step.row];
  }
}

void SparseLdlt::Backward(const double* off, double* x) const {
  const Entry* entry = entries_.data() + entries_.size();
  for (auto step = steps_.rbegin(); step != steps_.rend(); ++step) {
    double xr = x[step->row];
    for (int k = 0; k < step->count; ++k) {
      --entry;
      xr -= off[entry->place] * x[entry->row];
    }
    x[step->row] = xr;
  }
}

}  // namespace unfurl::sim
