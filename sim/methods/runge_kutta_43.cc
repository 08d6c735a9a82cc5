#include "sim/methods/runge_kutta_43.h"

#include <algorithm>
#include <utility>

#include "base/loop.h"

namespace unfurl::sim {
namespace {

// The embedded weights put the rate at the trial state in the place of the fourth stage, whose
// weight this is. Any smaller part would keep order three too, and the tolerance less well.
constexpr double kMoved = 1.0 / 6.0;
// Both rates that it compares are those of the step's end, and a bounce that begins and ends within
// the step shows in neither. A second embedded formula moves weight from one middle stage, of 1/3,
// to the other. A quarter of the weight costs 9% more evaluations in the deployment at 1e-3 and
// takes away the steps that gained energy in a contact; half of it 50%.
constexpr double kExchanged = 1.0 / 12.0;
// h |lambda| at the edge of stability: 2.79 along the real axis, 2.83 along the imaginary one.
constexpr double kStabilityEdge = 2.8;

}  // namespace

RungeKutta43::RungeKutta43(Dynamics& dynamics, const ErrorScale& scale) : Stepper(dynamics, scale) {
  for (Array& k : k_) k.assign(size_, 0.0);
}

void RungeKutta43::Refresh() {
  dynamics_.RightSide(t_, y_.data(), k_[0].data());
  ++evaluations_;
}

double RungeKutta43::Try(double h) {
  const int size = size_;
  const double* __restrict y = y_.data();
  const double* __restrict k1 = k_[0].data();
  const double* __restrict k2 = k_[1].data();
  const double* __restrict k3 = k_[2].data();
  const double* __restrict k4 = k_[3].data();
  double* __restrict s = stage_.data();
  double* __restrict out = trial_.data();
  h_ = h;
  UNFURL_INDEPENDENT
  for (int i = 0; i < size; ++i) s[i] = y[i] + 0.5 * h * k1[i];
  if (!Stage(t_ + 0.5 * h, s, k_[1].data())) return kGivenUp;
  UNFURL_INDEPENDENT
  for (int i = 0; i < size; ++i) s[i] = y[i] + 0.5 * h * k2[i];
  if (!Stage(t_ + 0.5 * h, s, k_[2].data())) return kGivenUp;
  UNFURL_INDEPENDENT
  for (int i = 0; i < size; ++i) s[i] = y[i] + h * k3[i];
  if (!Stage(t_ + h, s, k_[3].data())) return kGivenUp;
  UNFURL_INDEPENDENT
  for (int i = 0; i < size; ++i) {
    out[i] = y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
  }
  if (!Stage(t_ + h, out, k_[4].data())) return kGivenUp;
  const double* __restrict k5 = k_[4].data();
  const double at_end = Norm(y, out, [=](int i) { return h * kMoved * (k5[i] - k4[i]); });
  const double at_middle = Norm(y, out, [=](int i) { return h * kExchanged * (k3[i] - k2[i]); });
  return std::max(at_end, at_middle);
}

double RungeKutta43::ErrorOf(int i) const { return h_ * kMoved * (k_[4][i] - k_[3][i]); }

// The last stage and the trial stand at the same time.
double RungeKutta43::StabilityUse() const {
  return h_ / kStabilityEdge *
         FastestRate(trial_.data(), k_[4].data(), stage_.data(), k_[3].data());
}

double RungeKutta43::StabilityEdge() const { return kStabilityEdge; }

double RungeKutta43::StableReach() const {
  return kStabilityEdge / 4;  // right sides a step
}

void RungeKutta43::Accept(double t) {
  t_ = t;
  std::swap(y_, trial_);
  std::swap(k_[0], k_[4]);
}

DensePolynomial RungeKutta43::Polynomial(int i) {
  const double d = trial_[i] - y_[i], a = h_ * k_[0][i], b = h_ * k_[4][i];
  return {{y_[i], a, 3.0 * d - 2.0 * a - b, a + b - 2.0 * d}, 4};
}

}  // namespace unfurl::sim
