#include "sim/methods/dormand_prince.h"

#include <algorithm>

#include "base/loop.h"

namespace unfurl::sim {
namespace {

// Dormand and Prince 1980, as in Hairer, Norsett and Wanner, Solving ODEs I, table II.5.2.
constexpr double kA21 = 1.0 / 5;
constexpr double kA31 = 3.0 / 40, kA32 = 9.0 / 40;
constexpr double kA41 = 44.0 / 45, kA42 = -56.0 / 15, kA43 = 32.0 / 9;
constexpr double kA51 = 19372.0 / 6561, kA52 = -25360.0 / 2187, kA53 = 64448.0 / 6561,
                 kA54 = -212.0 / 729;
constexpr double kA61 = 9017.0 / 3168, kA62 = -355.0 / 33, kA63 = 46732.0 / 5247, kA64 = 49.0 / 176,
                 kA65 = -5103.0 / 18656;
constexpr double kB1 = 35.0 / 384, kB3 = 500.0 / 1113, kB4 = 125.0 / 192, kB5 = -2187.0 / 6784,
                 kB6 = 11.0 / 84;
// Difference between the fifth and the fourth order weights.
constexpr double kE1 = 71.0 / 57600, kE3 = -71.0 / 16695, kE4 = 71.0 / 1920,
                 kE5 = -17253.0 / 339200, kE6 = 22.0 / 525, kE7 = -1.0 / 40;
// Dense output of fourth order (Shampine), of the same book's DOPRI5.
constexpr double kD1 = -12715105075.0 / 11282082432.0, kD3 = 87487479700.0 / 32700410799.0,
                 kD4 = -10690763975.0 / 1880347072.0, kD5 = 701980252875.0 / 199316789632.0,
                 kD6 = -1453857185.0 / 822651844.0, kD7 = 69997945.0 / 29380423.0;

// From here on h |lambda| is at the edge of stability (Hairer, Norsett and Wanner's own value).
constexpr double kStabilityEdge = 3.25;

}  // namespace

DormandPrince::DormandPrince(Dynamics& dynamics, const ErrorScale& scale)
    : Stepper(dynamics, scale) {
  for (Array& k : k_) k.assign(size_, 0.0);
}

void DormandPrince::Refresh() {
  dynamics_.RightSide(t_, y_.data(), k_[0].data());
  ++evaluations_;
}

void DormandPrince::RefreshTrial() {
  dynamics_.RightSide(t_ + h_, trial_.data(), k_[6].data());
  ++evaluations_;
}

double DormandPrince::Try(double h) {
  const int size = size_;
  const double* __restrict y = y_.data();
  const double* __restrict k1 = k_[0].data();
  const double* __restrict k2 = k_[1].data();
  const double* __restrict k3 = k_[2].data();
  const double* __restrict k4 = k_[3].data();
  const double* __restrict k5 = k_[4].data();
  const double* __restrict k6 = k_[5].data();
  double* __restrict s = stage_.data();
  double* __restrict out = trial_.data();
  h_ = h;
  UNFURL_INDEPENDENT
  for (int i = 0; i < size; ++i) s[i] = y[i] + h * (kA21 * k1[i]);
  if (!Stage(t_ + 0.2 * h, s, k_[1].data())) return kGivenUp;
  UNFURL_INDEPENDENT
  for (int i = 0; i < size; ++i) s[i] = y[i] + h * (kA31 * k1[i] + kA32 * k2[i]);
  if (!Stage(t_ + 0.3 * h, s, k_[2].data())) return kGivenUp;
  UNFURL_INDEPENDENT
  for (int i = 0; i < size; ++i) s[i] = y[i] + h * (kA41 * k1[i] + kA42 * k2[i] + kA43 * k3[i]);
  if (!Stage(t_ + 0.8 * h, s, k_[3].data())) return kGivenUp;
  UNFURL_INDEPENDENT
  for (int i = 0; i < size; ++i) {
    s[i] = y[i] + h * (kA51 * k1[i] + kA52 * k2[i] + kA53 * k3[i] + kA54 * k4[i]);
  }
  if (!Stage(t_ + 8.0 / 9.0 * h, s, k_[4].data())) return kGivenUp;
  UNFURL_INDEPENDENT
  for (int i = 0; i < size; ++i) {
    s[i] = y[i] + h * (kA61 * k1[i] + kA62 * k2[i] + kA63 * k3[i] + kA64 * k4[i] + kA65 * k5[i]);
  }
  if (!Stage(t_ + h, s, k_[5].data())) return kGivenUp;
  UNFURL_INDEPENDENT
  for (int i = 0; i < size; ++i) {
    out[i] = y[i] + h * (kB1 * k1[i] + kB3 * k3[i] + kB4 * k4[i] + kB5 * k5[i] + kB6 * k6[i]);
  }
  if (!Stage(t_ + h, out, k_[6].data())) return kGivenUp;
  const double* __restrict k7 = k_[6].data();
  return Norm(y, out, [=](int i) {
    return h * (kE1 * k1[i] + kE3 * k3[i] + kE4 * k4[i] + kE5 * k5[i] + kE6 * k6[i] + kE7 * k7[i]);
  });
}

double DormandPrince::ErrorOf(int i) const {
  return h_ * (kE1 * k_[0][i] + kE3 * k_[2][i] + kE4 * k_[3][i] + kE5 * k_[4][i] + kE6 * k_[5][i] +
               kE7 * k_[6][i]);
}

void DormandPrince::Accept(double t) {
  t_ = t;
  std::swap(y_, trial_);
  std::swap(k_[0], k_[6]);
}

double DormandPrince::StabilityUse() const {
  return h_ / kStabilityEdge *
         FastestRate(trial_.data(), k_[6].data(), stage_.data(), k_[5].data());
}

double DormandPrince::StabilityEdge() const { return kStabilityEdge; }

double DormandPrince::StableReach() const {
  return kStabilityEdge / 6;  // right sides a step
}

double DormandPrince::Dense(int i, double sigma) const {
  const double difference = trial_[i] - y_[i];
  const double c3 = h_ * k_[0][i] - difference;
  const double c4 = difference - h_ * k_[6][i] - c3;
  const double c5 = h_ * (kD1 * k_[0][i] + kD3 * k_[2][i] + kD4 * k_[3][i] + kD5 * k_[4][i] +
                          kD6 * k_[5][i] + kD7 * k_[6][i]);
  const double rest = 1.0 - sigma;
  return y_[i] + sigma * (difference + rest * (c3 + sigma * (c4 + rest * c5)));
}

void DormandPrince::Dense(double sigma, double* out) {
  for (int i = 0; i < size_; ++i) out[i] = Dense(i, sigma);
}

DensePolynomial DormandPrince::Polynomial(int i) {
  const double difference = trial_[i] - y_[i];
  const double c3 = h_ * k_[0][i] - difference;
  const double c4 = difference - h_ * k_[6][i] - c3;
  const double c5 = h_ * (kD1 * k_[0][i] + kD3 * k_[2][i] + kD4 * k_[3][i] + kD5 * k_[4][i] +
                          kD6 * k_[5][i] + kD7 * k_[6][i]);
  // s (d + (1 - s)(c3 + s (c4 + (1 - s) c5))), expanded.
  return {{y_[i], difference + c3, c4 + c5 - c3, -c4 - 2.0 * c5, c5}, 5};
}

}  // namespace unfurl::sim
