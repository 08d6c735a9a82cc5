#include "correlate/residual/lowpass.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>
#include <vector>

#include "base/error.h"

namespace unfurl::correlate {

namespace {

using Complex = std::complex<double>;

// Poles of unit cutoff in the upper half plane, and the real one of odd orders [rad/s].
std::vector<Complex> ButterworthPoles(int order) {
  std::vector<Complex> poles;
  for (int k = 0; k < (order + 1) / 2; ++k) {
    const double angle = 0.5 * std::numbers::pi * (1.0 + (2.0 * k + 1.0) / order);
    poles.emplace_back(std::cos(angle), 2 * k + 1 == order ? 0.0 : std::sin(angle));
  }
  return poles;
}

// The transfer function of these poles (and their conjugates), 1 at zero frequency.
double AmplitudeAt(double omega, const std::vector<Complex>& poles) {
  double amplitude = 1.0;
  for (const Complex& p : poles) {
    amplitude *= std::abs(p) / std::abs(Complex(0.0, omega) - p);
    if (p.imag() != 0.0) amplitude *= std::abs(p) / std::abs(Complex(0.0, omega) - std::conj(p));
  }
  return amplitude;
}

// Roots of the reverse Bessel polynomial sum_k (2n - k)! / (2^(n-k) k! (n - k)!) s^k [Thomson
// 1949], scaled to unit cutoff.
std::vector<Complex> BesselPoles(int order) {
  std::vector<double> a(static_cast<std::size_t>(order) + 1);
  for (int k = 0; k <= order; ++k) {
    a[static_cast<std::size_t>(k)] =
        std::exp(std::lgamma(2.0 * order - k + 1.0) - std::lgamma(k + 1.0) -
                 std::lgamma(order - k + 1.0) - (order - k) * std::numbers::ln2);
  }
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(order, order);
  companion.diagonal(-1).setOnes();
  for (int k = 0; k < order; ++k) companion(k, order - 1) = -a[static_cast<std::size_t>(k)];
  const Eigen::VectorXcd roots = companion.eigenvalues();
  constexpr double kReal = 1e-9;  // of the modulus: round-off of a real root
  std::vector<Complex> poles;
  for (const Complex& p : roots) {
    if (std::abs(p.imag()) < kReal * std::abs(p)) {
      poles.emplace_back(p.real(), 0.0);
    } else if (p.imag() > 0.0) {
      poles.push_back(p);
    }
  }
  // The amplitude falls from 1 to nothing: bisection for 1/sqrt(2).
  double low = 0.0, high = 1.0;
  while (AmplitudeAt(high, poles) > std::numbers::sqrt2 / 2.0) high *= 2.0;
  for (int i = 0; i < 60; ++i) {  // halvings: to round-off
    const double middle = 0.5 * (low + high);
    (AmplitudeAt(middle, poles) > std::numbers::sqrt2 / 2.0 ? low : high) = middle;
  }
  for (Complex& p : poles) p /= low;
  return poles;
}

// One real pole, or a pair: x' = A x + B u, y = x_0, discretised exactly for an input that is
// linear within a step: the exponential of [A B 0; 0 0 1; 0 0 0] h [Van Loan 1978].
class Section {
 public:
  Section(const Complex& pole, double step) : size_(pole.imag() == 0.0 ? 1 : 2) {
    Eigen::MatrixXd M = Eigen::MatrixXd::Zero(size_ + 2, size_ + 2);
    const double square = std::norm(pole);
    if (size_ == 1) {
      M(0, 0) = pole.real();
      M(0, 1) = -pole.real();
    } else {
      M(0, 1) = 1.0;
      M(1, 0) = -square;
      M(1, 1) = 2.0 * pole.real();
      M(1, 2) = square;
    }
    M *= step;
    M(size_, size_ + 1) = 1.0;  // the input changes by its difference over the step
    const Eigen::MatrixXd E = M.exp();
    for (int i = 0; i < size_; ++i) {
      for (int j = 0; j < size_; ++j) A_[i][j] = E(i, j);
      b_[i] = E(i, size_);
      d_[i] = E(i, size_ + 1);
    }
  }

  void Run(Eigen::VectorXd* values) const {
    Eigen::VectorXd& u = *values;
    double x[2] = {u(0), 0.0};  // at rest
    double before = u(0);
    for (Eigen::Index i = 1; i < u.size(); ++i) {
      const double now = u(i), difference = now - before;
      const double x0 = A_[0][0] * x[0] + A_[0][1] * x[1] + b_[0] * before + d_[0] * difference;
      x[1] = A_[1][0] * x[0] + A_[1][1] * x[1] + b_[1] * before + d_[1] * difference;
      x[0] = x0;
      u(i) = x0;
      before = now;
    }
  }

 private:
  int size_;
  double A_[2][2] = {}, b_[2] = {}, d_[2] = {};
};

// Mean over `width` before each point, of values linear in between.
Eigen::VectorXd Average(const Eigen::VectorXd& values, double step, double width) {
  const Eigen::Index n = values.size();
  Eigen::VectorXd integral(n), out(n);
  integral(0) = 0.0;
  for (Eigen::Index i = 1; i < n; ++i) {
    integral(i) = integral(i - 1) + 0.5 * step * (values(i - 1) + values(i));
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    const double from = static_cast<double>(i) - width / step;  // in points
    double before = from * step * values(0);                    // of a time before the first
    if (from >= 0.0) {
      const auto k = std::min(static_cast<Eigen::Index>(from), n - 2);
      const double part = from - static_cast<double>(k);
      before = integral(k) + step * part * (values(k) + 0.5 * part * (values(k + 1) - values(k)));
    }
    out(i) = (integral(i) - before) / width;
  }
  return out;
}

}  // namespace

void LowPass::Check() const {
  if (kind == Kind::kNone) return;
  if (kind == Kind::kAverage) {
    if (!(width > 0.0) || !std::isfinite(width)) {
      throw Error("an average over no time", "filter.width", "give its width in s");
    }
    return;
  }
  if (order < 1 || order > kHighestOrder) {
    throw Error("a filter's order is 1 to " + std::to_string(kHighestOrder), "filter.order",
                "give the order of the instrument's filter");
  }
  if (!(cutoff > 0.0) || !std::isfinite(cutoff)) {
    throw Error("a filter without a cutoff", "filter.cutoff",
                "give the frequency in Hz at which the amplitude has fallen to 0.707");
  }
}

namespace {

// In the upper half plane [rad/s].
std::vector<Complex> PolesOf(const LowPass& filter) {
  const bool bessel = filter.kind == LowPass::Kind::kBessel;
  std::vector<Complex> poles = bessel ? BesselPoles(filter.order) : ButterworthPoles(filter.order);
  for (Complex& p : poles) p *= 2.0 * std::numbers::pi * filter.cutoff;
  return poles;
}

}  // namespace

double LowPass::Memory() const {
  if (kind == Kind::kNone) return 0.0;
  if (kind == Kind::kAverage) return width;
  double slowest = std::numeric_limits<double>::infinity();
  for (const Complex& p : PolesOf(*this)) slowest = std::min(slowest, -p.real());
  constexpr double kDecay = 6.9;  // ln 1000
  return kDecay / slowest;
}

Eigen::VectorXd LowPass::Apply(const Eigen::VectorXd& values, double step) const {
  if (kind == Kind::kNone || values.size() < 2) return values;
  if (kind == Kind::kAverage) return Average(values, step, width);
  Eigen::VectorXd out = values;
  for (const Complex& pole : PolesOf(*this)) Section(pole, step).Run(&out);
  return out;
}

}  // namespace unfurl::correlate
