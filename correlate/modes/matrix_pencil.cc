#include "correlate/modes/matrix_pencil.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/dense.h"
#include "base/statistics.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

using Complex = std::complex<double>;

// Samples a stretch: the eigenproblem has a third of them.
constexpr double kLongestRecord = 1200.0;
constexpr double kPass = 0.4;  // of the new rate: what the filter lets through unharmed

std::vector<double> WithoutTrend(const DecaySignal& s, int degree) {
  const auto n = static_cast<Eigen::Index>(s.t.size());
  const Eigen::Map<const Eigen::VectorXd> y(s.value.data(), n);
  Eigen::VectorXd left = y;
  if (degree >= 0 && n > degree + 1) {
    Eigen::MatrixXd p(n, degree + 1);
    const double middle = 0.5 * (s.t.front() + s.t.back());
    const double half = std::max(0.5 * (s.t.back() - s.t.front()), 1e-300);
    for (Eigen::Index i = 0; i < n; ++i) {
      double power = 1.0;
      for (int d = 0; d <= degree; ++d, power *= (s.t[static_cast<std::size_t>(i)] - middle) / half)
        p(i, d) = power;
    }
    left -= p * p.householderQr().solve(y);
  }
  return {left.data(), left.data() + n};
}

// Windowed sinc, symmetric: an exponential comes out as the same exponential times a number.
Eigen::VectorXd LowPassTaps(std::size_t factor) {
  constexpr int kLobes = 8;  // half-length in new steps: 60 dB and a narrow edge
  const auto half = static_cast<Eigen::Index>(kLobes * factor);
  Eigen::VectorXd h(2 * half + 1);
  const double cut = 1.0 / static_cast<double>(factor);  // of the old Nyquist frequency
  for (Eigen::Index i = 0; i < h.size(); ++i) {
    const double x = std::numbers::pi * static_cast<double>(i - half);
    const double sinc = i == half ? cut : std::sin(cut * x) / x;
    h(i) = sinc * (0.5 + 0.5 * std::cos(x / static_cast<double>(half + 1)));
  }
  return h / h.sum();
}

// One stretch of stamps without a gap, every `factor`-th of a grid of `step`.
EvenSignals::Stretch Regrid(std::span<const double> t, std::span<const double> y, double step,
                            std::size_t factor) {
  constexpr double kSame = 1e-3;  // of a step: nearer than this, interpolation would only blur
  const auto n = static_cast<Eigen::Index>((t.back() - t.front()) / step + 1e-6) + 1;
  Eigen::VectorXd even(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double at = t.front() + static_cast<double>(i) * step;
    const auto same = static_cast<std::size_t>(i);
    if (same < t.size() && std::abs(t[same] - at) < kSame * step) {
      even(i) = y[same];
      continue;
    }
    const LocalCubic c = CubicAt(t, at);
    even(i) = 0.0;
    for (int j = 0; j < c.count; ++j)
      even(i) += c.value[j] * y[c.first + static_cast<std::size_t>(j)];
  }
  EvenSignals::Stretch out;
  out.start = t.front();
  if (factor == 1) {
    out.value = std::move(even);
    return out;
  }
  const Eigen::VectorXd h = LowPassTaps(factor);
  const Eigen::Index skip = static_cast<Eigen::Index>(factor);
  const Eigen::Index count = n < h.size() ? 0 : (n - h.size()) / skip + 1;
  const Eigen::Index half = h.size() / 2;  // of an odd number
  out.start += static_cast<double>(half) * step;
  out.value.resize(count);
  for (Eigen::Index i = 0; i < count; ++i) out.value(i) = h.dot(even.segment(i * skip, h.size()));
  return out;
}

// Sum over all windows of their outer products: entry (i, j) is sum over w of y(w + i) y(w + j).
Eigen::MatrixXd WindowProducts(const EvenSignals& even, Eigen::Index columns) {
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(columns, columns);
  for (const auto& signal : even.signals) {
    for (const auto& stretch : signal) {
      const Eigen::VectorXd& y = stretch.value;
      const Eigen::Index windows = y.size() - columns + 1;
      if (windows < 1) continue;
      for (Eigen::Index lag = 0; lag < columns; ++lag) {
        double sum = y.head(windows).dot(y.segment(lag, windows));
        G(lag, 0) += sum;
        for (Eigen::Index i = 1; i + lag < columns; ++i) {
          sum += y(windows + i - 1) * y(windows + i + lag - 1) - y(i - 1) * y(i + lag - 1);
          G(i + lag, i) += sum;
        }
      }
    }
  }
  return G;
}

// Amplitudes of all poles of one order, by least squares, signal by signal.
void FillShapes(const EvenSignals& even, double duration, PencilOrder* order) {
  const auto count = static_cast<Eigen::Index>(order->poles.size());
  const auto signals = static_cast<Eigen::Index>(even.signals.size());
  order->shapes.assign(order->poles.size(), Eigen::VectorXcd::Zero(signals));
  for (Eigen::Index j = 0; j < signals; ++j) {
    Eigen::Index n = 0;
    for (const auto& s : even.signals[static_cast<std::size_t>(j)]) n += s.value.size();
    if (n < 2 * count) continue;
    Eigen::MatrixXd basis(n, 2 * count);
    Eigen::VectorXd y(n);
    Eigen::Index row = 0;
    for (const auto& s : even.signals[static_cast<std::size_t>(j)]) {
      for (Eigen::Index k = 0; k < count; ++k) {
        const Complex pole = order->poles[static_cast<std::size_t>(k)];
        // A growing pole is scaled to 1 at the end, so that nothing overflows.
        const double from = pole.real() > 0.0 ? duration : 0.0;
        Complex value = std::exp(pole * (s.start - from));
        const Complex step = std::exp(pole * even.step);
        for (Eigen::Index i = 0; i < s.value.size(); ++i, value *= step) {
          basis(row + i, 2 * k) = value.real();
          basis(row + i, 2 * k + 1) = pole.imag() > 0.0 ? value.imag() : 0.0;
        }
      }
      y.segment(row, s.value.size()) = s.value;
      row += s.value.size();
    }
    Eigen::MatrixXd normal = basis.transpose() * basis;
    // A little weight keeps empty columns (real poles) and near twins solvable.
    normal.diagonal().array() += 1e-10 * normal.diagonal().maxCoeff();
    const Eigen::VectorXd c = normal.ldlt().solve(basis.transpose() * y);
    for (Eigen::Index k = 0; k < count; ++k) {
      order->shapes[static_cast<std::size_t>(k)](j) = {c(2 * k), -c(2 * k + 1)};
    }
  }
}

}  // namespace

EvenSignals OnEvenGrid(std::span<const DecaySignal> signals, int trend, double high) {
  EvenSignals out;
  double first = std::numeric_limits<double>::infinity(), longest = 0.0;
  for (const DecaySignal& s : signals) {
    if (s.t.size() < 2) continue;
    out.step = std::max(out.step, MedianStep(s.t));
    first = std::min(first, s.t.front());
    longest = std::max(longest, s.t.back() - s.t.front());
  }
  if (!(out.step > 0.0)) return out;
  double factor = std::ceil(longest / out.step / kLongestRecord);
  if (std::isfinite(high)) {
    // No coarser than the band allows; as coarse as it allows, since slow poles then lie apart.
    factor = std::max(1.0, std::floor(kPass / (high * out.step)));
    if (longest / (factor * out.step) < 60.0) factor = 1.0;
  }
  factor = std::max(1.0, factor);
  out.step *= factor;
  out.high = kPass / out.step;
  if (factor == 1.0) out.high = 0.5 / out.step;
  bool weighted = true;
  for (const DecaySignal& s : signals) weighted = weighted && s.sigma.size() == s.t.size();
  for (const DecaySignal& s : signals) {
    std::vector<EvenSignals::Stretch> stretches;
    if (s.t.size() >= 4) {
      const double own = MedianStep(s.t);
      // A faster signal is filtered down to the common step.
      const auto skip = static_cast<std::size_t>(std::max(1.0, std::floor(out.step / own + 1e-3)));
      const double step = out.step / static_cast<double>(skip);
      const std::vector<double> y = WithoutTrend(s, trend);
      std::size_t from = 0;
      for (std::size_t i = 1; i <= s.t.size(); ++i) {
        if (i < s.t.size() && s.t[i] - s.t[i - 1] <= SampledModel::kMaxGap * own) continue;
        if (i - from >= 8) {
          auto stretch = Regrid(std::span(s.t).subspan(from, i - from),
                                std::span(y).subspan(from, i - from), step, skip);
          stretch.start -= first;
          if (weighted) stretch.value /= Mean(s.sigma);
          if (stretch.value.size() > 0) stretches.push_back(std::move(stretch));
        }
        from = i;
      }
    }
    out.signals.push_back(std::move(stretches));
  }
  return out;
}

std::vector<PencilOrder> MatrixPencil(const EvenSignals& even, int max_order) {
  constexpr Eigen::Index kFewest = 8;  // columns
  std::vector<PencilOrder> out;
  Eigen::Index longest = 0;
  double duration = 0.0;
  for (const auto& signal : even.signals) {
    for (const auto& s : signal) {
      longest = std::max(longest, s.value.size());
      duration = std::max(duration, s.start + even.step * static_cast<double>(s.value.size()));
    }
  }
  // A third of the samples: where the scatter of the poles is least [Hua and Sarkar 1990].
  const Eigen::Index columns = longest / 3;
  if (columns < kFewest) return out;
  const Eigen::MatrixXd G = WindowProducts(even, columns);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(G);
  const Eigen::Index most = std::min<Eigen::Index>(2 * (max_order / 2), 2 * ((columns - 2) / 4));
  // Largest first.
  const Eigen::MatrixXd V = eigen.eigenvectors().rightCols(most).rowwise().reverse();
  const Eigen::MatrixXd shifted = V.topRows(columns - 1).transpose() * V.bottomRows(columns - 1);
  for (Eigen::Index n = 2; n <= most; n += 2) {
    // V_up^T V_up = I - v v^T, v the last row: inverted in closed form.
    const Eigen::VectorXd v = V.row(columns - 1).head(n).transpose();
    const double rest = 1.0 - v.squaredNorm();
    if (!(rest > 1e-12)) continue;
    Eigen::MatrixXd psi = shifted.topLeftCorner(n, n);
    psi += (v / rest) * (v.transpose() * psi).eval();
    const Eigen::EigenSolver<Eigen::MatrixXd> solver(psi, false);
    PencilOrder order;
    order.order = static_cast<int>(n);
    for (Eigen::Index k = 0; k < n; ++k) {
      const Complex z = solver.eigenvalues()(k);
      if (z.imag() < 0.0 || std::abs(z) < 1e-6) continue;
      order.poles.push_back(std::log(z) / even.step);
    }
    std::sort(order.poles.begin(), order.poles.end(),
              [](Complex a, Complex b) { return std::abs(a) < std::abs(b); });
    FillShapes(even, duration, &order);
    out.push_back(std::move(order));
  }
  return out;
}

}  // namespace unfurl::correlate
