#include "sim/methods/dormand_prince8.h"

#include <algorithm>
#include <utility>

#include "base/loop.h"
#include "sim/methods/dormand_prince8_table.h"

namespace unfurl::sim {
namespace {

using namespace dop853;

// From here on h |lambda| is at the edge of stability (the source's own value).
constexpr double kStabilityEdge = 6.1;

// out = y + h sum(weight k[stage]); unrolled over the terms, vectorised over the entries.
template <std::size_t N>
inline void Combine(const std::array<Array, 16>& k, const Terms<N>& terms, double h,
                    const double* __restrict y, double* __restrict out, int size) {
  const double* stage[N];
  double weight[N];
  for (std::size_t t = 0; t < N; ++t) {
    stage[t] = k[terms[t].stage].data();
    weight[t] = terms[t].weight;
  }
  UNFURL_INDEPENDENT
  for (int i = 0; i < size; ++i) {
    double sum = 0.0;
#pragma GCC unroll 12
    for (std::size_t t = 0; t < N; ++t) sum += weight[t] * stage[t][i];
    out[i] = y[i] + h * sum;
  }
}

// out = h sum(weight k[stage]), likewise: without the places of the stages in local pointers the
// compiler gathers entry by entry, which took a tenth of a run.
template <std::size_t N>
inline void CombineSlopes(const std::array<Array, 16>& k, const Terms<N>& terms, double h,
                          double* __restrict out, int size) {
  const double* stage[N];
  double weight[N];
  for (std::size_t t = 0; t < N; ++t) {
    stage[t] = k[terms[t].stage].data();
    weight[t] = terms[t].weight;
  }
  UNFURL_INDEPENDENT
  for (int i = 0; i < size; ++i) {
    double sum = 0.0;
#pragma GCC unroll 12
    for (std::size_t t = 0; t < N; ++t) sum += weight[t] * stage[t][i];
    out[i] = h * sum;
  }
}

template <std::size_t N>
inline double Sum(const std::array<Array, 16>& k, const Terms<N>& terms, int i) {
  double sum = 0.0;
  for (std::size_t t = 0; t < N; ++t) sum += terms[t].weight * k[terms[t].stage][i];
  return sum;
}

}  // namespace

DormandPrince8::DormandPrince8(Dynamics& dynamics, const ErrorScale& scale)
    : Stepper(dynamics, scale) {
  for (Array& k : k_) k.assign(size_, 0.0);
  inner_.assign(size_, 0.0);
  inner_rate_.assign(size_, 0.0);
}

void DormandPrince8::Refresh() {
  dynamics_.RightSide(t_, y_.data(), k_[0].data());
  ++evaluations_;
}

void DormandPrince8::RefreshTrial() {
  dynamics_.RightSide(t_ + h_, trial_.data(), k_[12].data());
  ++evaluations_;
  dense_ = false;
}

double DormandPrince8::Try(double h) {
  const double* y = y_.data();
  double* s = stage_.data();
  h_ = h;
  dense_ = false;
  const auto stage = [&](int k, const auto& terms) {
    Combine(k_, terms, h, y, s, size_);
    dynamics_.RightSide(t_ + kC[k] * h, s, k_[k].data());
  };
  stage(1, kA1);
  stage(2, kA2);
  stage(3, kA3);
  stage(4, kA4);
  stage(5, kA5);
  stage(6, kA6);
  stage(7, kA7);
  stage(8, kA8);
  stage(9, kA9);
  stage(10, kA10);
  stage(11, kA11);
  Combine(k_, kB, h, y, trial_.data(), size_);
  evaluations_ += 11;

  const double* __restrict k0 = k_[0].data();
  const double* __restrict k5 = k_[5].data();
  const double* __restrict k6 = k_[6].data();
  const double* __restrict k7 = k_[7].data();
  const double* __restrict k8 = k_[8].data();
  const double* __restrict k9 = k_[9].data();
  const double* __restrict k10 = k_[10].data();
  const double* __restrict k11 = k_[11].data();
  const double fifth = Norm(y, trial_.data(), [=](int i) {
    return kE5[0].weight * k0[i] + kE5[1].weight * k5[i] + kE5[2].weight * k6[i] +
           kE5[3].weight * k7[i] + kE5[4].weight * k8[i] + kE5[5].weight * k9[i] +
           kE5[6].weight * k10[i] + kE5[7].weight * k11[i];
  });
  const double third = Norm(y, trial_.data(), [=](int i) {
    return (kB[0].weight - kThird0) * k0[i] + kB[1].weight * k5[i] + kB[2].weight * k6[i] +
           kB[3].weight * k7[i] + (kB[4].weight - kThird8) * k8[i] + kB[5].weight * k9[i] +
           kB[6].weight * k10[i] + (kB[7].weight - kThird11) * k11[i];
  });
  // Of the order of h^8, where the estimates themselves are of h^6 and h^4.
  const double both = fifth * fifth + 0.01 * third * third;
  const double error = both > 0.0 ? h * fifth * fifth / std::sqrt(both) : h * both;
  if (error <= 1.0) {
    dynamics_.RightSide(t_ + h, trial_.data(), k_[12].data());
    ++evaluations_;
  }
  return error;
}

double DormandPrince8::ErrorOf(int i) const { return h_ * Sum(k_, kE5, i); }

void DormandPrince8::Accept(double t) {
  t_ = t;
  std::swap(y_, trial_);
  std::swap(k_[0], k_[12]);
  dense_ = false;
}

double DormandPrince8::StabilityUse() const {
  return h_ / kStabilityEdge *
         FastestRate(trial_.data(), k_[12].data(), stage_.data(), k_[11].data());
}

double DormandPrince8::StabilityEdge() const { return kStabilityEdge; }

double DormandPrince8::StableReach() const {
  return kStabilityEdge / 12;  // right sides a step
}

void DormandPrince8::MakeDense() {
  if (dense_) return;
  dense_ = true;
  const double* y = y_.data();
  double* s = inner_.data();
  const auto stage = [&](int k, const auto& terms) {
    Combine(k_, terms, h_, y, s, size_);
    dynamics_.RightSide(t_ + kC[k] * h_, s, k_[k].data());
  };
  stage(13, kA13);
  stage(14, kA14);
  stage(15, kA15);
  evaluations_ += 3;
  // Over stages that are not needed any more; the table reads none of these.
  for (std::size_t d = 0; d < 4; ++d) CombineSlopes(k_, kD[d], h_, k_[1 + d].data(), size_);
}

// y + s (c1 + (1 - s)(c2 + s (c3 + (1 - s)(c4 + s (c5 + (1 - s)(c6 + s c7)))))), expanded.
DensePolynomial DormandPrince8::Polynomial(int i) {
  MakeDense();
  const double c1 = trial_[i] - y_[i];
  const double c2 = h_ * k_[0][i] - c1;
  const double c3 = c1 - h_ * k_[12][i] - c2;
  const double nested[7] = {c1, c2, c3, k_[1][i], k_[2][i], k_[3][i], k_[4][i]};
  DensePolynomial p{{nested[6]}, 1};
  for (int level = 5; level >= 0; --level) {
    // Multiply by s (even places of nested) or by 1 - s, and add the next coefficient.
    const bool by_s = level % 2 == 1;
    for (int k = p.count; k > 0; --k)
      p.c[k] = by_s ? p.c[k - 1] : (k < p.count ? p.c[k] : 0.0) - p.c[k - 1];
    if (by_s) p.c[0] = 0.0;
    ++p.count;
    p.c[0] += nested[level];
  }
  for (int k = p.count; k > 0; --k) p.c[k] = p.c[k - 1];
  ++p.count;
  p.c[0] = y_[i];
  return p;
}

void DormandPrince8::Dense(double sigma, double* out) {
  MakeDense();
  const double rest = 1.0 - sigma;
  const double* __restrict y = y_.data();
  const double* __restrict trial = trial_.data();
  const double* __restrict k0 = k_[0].data();
  const double* __restrict k12 = k_[12].data();
  const double* __restrict c4 = k_[1].data();
  const double* __restrict c5 = k_[2].data();
  const double* __restrict c6 = k_[3].data();
  const double* __restrict c7 = k_[4].data();
  UNFURL_INDEPENDENT
  for (int i = 0; i < size_; ++i) {
    const double c1 = trial[i] - y[i];
    const double c2 = h_ * k0[i] - c1;
    const double c3 = c1 - h_ * k12[i] - c2;
    const double high = c4[i] + sigma * (c5[i] + rest * (c6[i] + sigma * c7[i]));
    out[i] = y[i] + sigma * (c1 + rest * (c2 + sigma * (c3 + rest * high)));
  }
}

double DormandPrince8::DenseDoubt(double sigma) {
  Dense(sigma, inner_.data());
  dynamics_.RightSide(t_ + sigma * h_, inner_.data(), inner_rate_.data());
  ++evaluations_;
  for (int i = 3 * n_; i < 6 * n_; ++i) {
    inner_rate_[i] = h_ * inner_rate_[i] - Polynomial(i).Slope(sigma);
  }
  const auto velocities = [&](int i) { return i < 3 * n_ || i >= 6 * n_ ? 0.0 : inner_rate_[i]; };
  return Norm(y_.data(), trial_.data(), velocities);
}

// Through both ends with their slopes. What the slopes of the stages in between differ by from the
// cubic's bounds how far it can be off.
DensePolynomial DormandPrince8::Cubic(int i, double* margin) const {
  const double c1 = trial_[i] - y_[i];
  const double c2 = h_ * k_[0][i] - c1;
  const double c3 = c1 - h_ * k_[12][i] - c2;
  const DensePolynomial cubic{{y_[i], c1 + c2, c3 - c2, -c3}, 4};
  double worst = 0.0;
  for (const int stage : {5, 6, 7, 8, 9, 10}) {
    worst = std::max(worst, std::fabs(h_ * k_[stage][i] - cubic.Slope(kC[stage])));
  }
  *margin = worst;
  return cubic;
}

}  // namespace unfurl::sim
