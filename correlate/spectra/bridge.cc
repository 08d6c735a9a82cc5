#include "correlate/spectra/bridge.h"

#include <Eigen/SparseCholesky>
#include <cmath>
#include <cstdint>

#include "correlate/fit/autocorrelation.h"
#include "correlate/sampled_model.h"
#include "correlate/spectra/spectrum.h"

namespace unfurl::correlate {

namespace {

// The slot of each stamp on the even grid; empty: none is missing, too many are, or there is no
// such grid.
std::vector<std::size_t> SlotsWithGaps(std::span<const double> t) {
  constexpr double kMostMissing = 0.05;  // of the grid: what is put in is no measurement [-]
  constexpr double kOffGrid = 0.1;       // of a step: jitter of stamps [-]
  const std::size_t n = t.size();
  if (n < 8) return {};
  double step = MedianStep(t);
  if (!(step > 0.0)) return {};
  std::vector<std::size_t> slot(n, 0);
  for (std::size_t i = 1; i < n; ++i) {
    const double steps = (t[i] - t[i - 1]) / step;
    if (!(steps > 0.5) || steps > static_cast<double>(n)) return {};
    slot[i] = slot[i - 1] + static_cast<std::size_t>(std::lround(steps));
  }
  const auto all = static_cast<double>(slot.back() + 1);
  if (slot.back() + 1 == n || all - static_cast<double>(n) > kMostMissing * all) return {};
  step = (t.back() - t.front()) / static_cast<double>(slot.back());
  for (std::size_t i = 0; i < n; ++i) {
    if (std::abs(t[i] - t[0] - step * static_cast<double>(slot[i])) > kOffGrid * step) return {};
  }
  return slot;
}

// `x` with its missing values set to those at which the sum of the autoregression's squared errors
// is least: sum over missing j of b(|i - j|) x_j = -sum over known j of the same, b the correlation
// of its coefficients.
void PutIn(const std::vector<std::uint8_t>& known, std::vector<double>* x) {
  constexpr int kMostOrder = 32;  // sixteen sines
  const std::size_t n = x->size();
  const Autoregression model = FitAutoregression(*x, known, kMostOrder);
  std::vector<double> c(1, 1.0), b;
  for (const double a : model.a) c.push_back(-a);
  for (std::size_t lag = 0; lag < c.size(); ++lag) {
    b.push_back(0.0);
    for (std::size_t k = lag; k < c.size(); ++k) b.back() += c[k] * c[k - lag];
  }
  std::vector<std::size_t> missing;
  std::vector<int> place(n, -1);
  for (std::size_t i = 0; i < n; ++i) {
    if (known[i]) continue;
    place[i] = static_cast<int>(missing.size());
    missing.push_back(i);
  }
  const auto count = static_cast<Eigen::Index>(missing.size());
  std::vector<Eigen::Triplet<double>> terms;
  Eigen::VectorXd right = Eigen::VectorXd::Zero(count);
  const std::size_t reach = b.size() - 1;
  for (Eigen::Index m = 0; m < count; ++m) {
    const std::size_t i = missing[static_cast<std::size_t>(m)];
    const std::size_t from = i > reach ? i - reach : 0, to = std::min(n - 1, i + reach);
    for (std::size_t j = from; j <= to; ++j) {
      const double value = b[i > j ? i - j : j - i];
      if (place[j] >= 0) {
        terms.emplace_back(static_cast<int>(m), place[j], value);
      } else {
        right(m) -= value * (*x)[j];
      }
    }
  }
  Eigen::SparseMatrix<double> matrix(count, count);
  matrix.setFromTriplets(terms.begin(), terms.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
  if (solver.info() != Eigen::Success) return;
  const Eigen::VectorXd found = solver.solve(right);
  if (!found.allFinite()) return;
  for (Eigen::Index m = 0; m < count; ++m) (*x)[missing[static_cast<std::size_t>(m)]] = found(m);
}

// `x` on the grid: about the straight line through what is there, which is what remains where the
// autoregression says nothing.
std::vector<double> OnGrid(const std::vector<std::size_t>& slot,
                           const std::vector<std::uint8_t>& known, std::span<const double> x) {
  Eigen::MatrixX2d line(static_cast<Eigen::Index>(slot.size()), 2);
  for (std::size_t i = 0; i < slot.size(); ++i) {
    line.row(static_cast<Eigen::Index>(i)) << 1.0,
        static_cast<double>(slot[i]) / static_cast<double>(slot.back());
  }
  const Eigen::Map<const Eigen::VectorXd> values(x.data(), line.rows());
  const Eigen::Vector2d c = (line.transpose() * line).ldlt().solve(line.transpose() * values);
  const auto on_line = [&](std::size_t k) {
    return c(0) + c(1) * static_cast<double>(k) / static_cast<double>(slot.back());
  };
  std::vector<double> y(known.size(), 0.0);
  for (std::size_t i = 0; i < slot.size(); ++i) y[slot[i]] = x[i] - on_line(slot[i]);
  PutIn(known, &y);
  for (std::size_t k = 0; k < y.size(); ++k) y[k] += on_line(k);
  for (std::size_t i = 0; i < slot.size(); ++i) y[slot[i]] = x[i];
  return y;
}

}  // namespace

BridgedRecord BridgeGaps(std::span<const double> t,
                         const std::vector<std::span<const double>>& signals) {
  BridgedRecord out;
  const std::vector<std::size_t> slot = SlotsWithGaps(t);
  if (slot.empty()) {
    out.t.assign(t.begin(), t.end());
    for (const auto& x : signals) out.x.emplace_back(x.begin(), x.end());
    return out;
  }
  const std::size_t n = slot.back() + 1;
  out.filled = n - t.size();
  const double step = (t.back() - t.front()) / static_cast<double>(n - 1);
  std::vector<std::uint8_t> known(n, 0);
  for (std::size_t i = 0; i < n; ++i) out.t.push_back(t[0] + step * static_cast<double>(i));
  for (const std::size_t k : slot) known[k] = 1;
  for (const auto& x : signals) out.x.push_back(OnGrid(slot, known, x));
  return out;
}

}  // namespace unfurl::correlate
