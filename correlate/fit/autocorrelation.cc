#include "correlate/fit/autocorrelation.h"

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "base/statistics.h"
#include "correlate/residual/row_layout.h"
#include "correlate/sampled_model.h"
#include "correlate/spectra/fft.h"

namespace unfurl::correlate {

std::vector<double> Autoregression::Correlation(std::size_t max_lag) const {
  std::vector<double> rho(max_lag + 1, 0.0);
  rho[0] = 1.0;
  const std::size_t p = a.size();
  if (p == 0) return rho;
  // Yule-Walker: the first p correlations solve a linear system, the rest follow by recursion.
  Eigen::MatrixXd A =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(p), static_cast<Eigen::Index>(p));
  Eigen::VectorXd b = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(p));
  for (std::size_t l = 1; l <= p; ++l) {
    const auto row = static_cast<Eigen::Index>(l - 1);
    A(row, row) += 1.0;
    for (std::size_t j = 1; j <= p; ++j) {
      const std::size_t lag = l > j ? l - j : j - l;
      if (lag == 0) {
        b(row) += a[j - 1];
      } else {
        A(row, static_cast<Eigen::Index>(lag - 1)) -= a[j - 1];
      }
    }
  }
  const Eigen::VectorXd first = A.fullPivLu().solve(b);
  for (std::size_t l = 1; l <= max_lag; ++l) {
    if (l <= p) {
      rho[l] = std::clamp(first(static_cast<Eigen::Index>(l - 1)), -1.0, 1.0);
      continue;
    }
    for (std::size_t j = 1; j <= p; ++j) rho[l] += a[j - 1] * rho[l - j];
  }
  return rho;
}

double Autoregression::EffectiveCount() const {
  if (count == 0) return 0.0;
  const std::vector<double> rho = Correlation(count - 1);
  double sum = 1.0;
  for (std::size_t l = 1; l < count; ++l) {
    sum += 2.0 * (1.0 - static_cast<double>(l) / static_cast<double>(count)) * rho[l];
  }
  return static_cast<double>(count) / std::max(sum, 1.0 / static_cast<double>(count));
}

Autoregression FitAutoregression(std::span<const double> x, std::span<const std::uint8_t> known,
                                 int max_order) {
  Autoregression best;
  double sum = 0.0;
  std::size_t n = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (known[i]) sum += x[i] * x[i], ++n;
  }
  best.count = n;
  if (n == 0) return best;
  best.variance = best.innovation = sum / static_cast<double>(n);
  if (n < 20 || best.variance <= 0.0) return best;

  // Burg: forward errors f_i and backward errors b_(i-1), both valid where `reach[i]` samples
  // before i are known without a gap.
  std::vector<double> f(x.begin(), x.end()), b(x.begin(), x.end());
  std::vector<int> reach(x.size(), -1);
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (known[i]) reach[i] = (i > 0 && reach[i - 1] >= 0) ? reach[i - 1] + 1 : 0;
  }
  std::vector<double> a;
  double innovation = best.variance;
  const double log_n = std::log(static_cast<double>(n));
  double best_score = static_cast<double>(n) * std::log(innovation);
  for (int order = 1; order <= max_order; ++order) {
    double top = 0.0, bottom = 0.0;
    for (std::size_t i = 1; i < x.size(); ++i) {
      if (reach[i] < order) continue;
      top += f[i] * b[i - 1];
      bottom += 0.5 * (f[i] * f[i] + b[i - 1] * b[i - 1]);
    }
    if (bottom <= 0.0) break;
    const double k = top / bottom;  // |k| < 1 by construction
    std::vector<double> next(a);
    for (std::size_t j = 0; j < a.size(); ++j) next[j] = a[j] - k * a[a.size() - 1 - j];
    next.push_back(k);
    a = std::move(next);
    for (std::size_t i = x.size() - 1; i >= 1; --i) {
      if (reach[i] < order) continue;
      const double forward = f[i] - k * b[i - 1];
      b[i] = b[i - 1] - k * f[i];
      f[i] = forward;
    }
    innovation *= 1.0 - k * k;
    const double score = static_cast<double>(n) * std::log(innovation) + order * log_n;
    if (score < best_score) {
      best_score = score;
      best.a = a;
      best.innovation = innovation;
    }
  }
  return best;
}

double LjungBox(std::span<const double> x, std::span<const std::uint8_t> known, int lags) {
  double zero = 0.0;
  std::size_t n = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (known[i]) zero += x[i] * x[i], ++n;
  }
  if (n < static_cast<std::size_t>(4 * lags) || zero <= 0.0) return -1.0;
  double q = 0.0;
  for (int l = 1; l <= lags; ++l) {
    double c = 0.0;
    std::size_t pairs = 0;
    for (std::size_t i = static_cast<std::size_t>(l); i < x.size(); ++i) {
      if (!known[i] || !known[i - static_cast<std::size_t>(l)]) continue;
      c += x[i] * x[i - static_cast<std::size_t>(l)];
      ++pairs;
    }
    if (pairs == 0) continue;
    const double r = c / zero;  // variance of r: pairs / n^2
    q += r * r * static_cast<double>(n) * static_cast<double>(n) / static_cast<double>(pairs);
  }
  return q;
}

double WhitenessPValue(std::span<const double> x, std::span<const std::uint8_t> known, int lags) {
  const double q = LjungBox(x, known, lags);
  return q < 0.0 ? 1.0 : ChiSquareTail(q, lags);
}

ResidualNoise EstimateResidualNoise(const Observations& observations,
                                    const Eigen::VectorXd& residual, double unit_variance) {
  constexpr int kLags = 20;  // of the whiteness test
  ResidualNoise noise;
  double sum = 0.0, total = 0.0, effective = 0.0, statistic = 0.0, freedoms = 0.0;
  const RowLayout layout(observations);
  for (const RowSeries& mark : layout.series) {
    const std::vector<double>& t = *mark.t;
    const double step = MedianStep(t);
    std::vector<std::size_t> place(mark.size(), 0);
    std::vector<std::size_t> sample;
    for (std::size_t i = 0; i < mark.size(); ++i) {
      if (i > 0) {
        const double steps = step > 0.0 ? std::round((t[i] - t[i - 1]) / step) : 1.0;
        // A long gap decorrelates; its true length would only cost memory.
        place[i] = place[i - 1] + static_cast<std::size_t>(std::clamp(steps, 1.0, 1000.0));
      }
      if (mark.Known(residual, i)) sample.push_back(i);
    }
    for (int axis = 0; axis < mark.axes && !sample.empty(); ++axis) {
      ResidualNoise::Series s;
      s.mark = mark.name;
      s.axis = axis;
      const std::size_t slots = place[sample.back()] + 1;
      std::vector<double> x(slots, 0.0);
      std::vector<std::uint8_t> known(slots, 0);
      for (std::size_t i : sample) {
        const Eigen::Index row = mark.Row(i, axis);
        s.row.push_back(row);
        s.slot.push_back(place[i]);
        x[place[i]] = residual(row);
        known[place[i]] = 1;
      }
      s.model = FitAutoregression(x, known);
      const double q = LjungBox(x, known, kLags);
      s.p_value = q < 0.0 ? 1.0 : ChiSquareTail(q, kLags);
      if (q >= 0.0) statistic += q, freedoms += kLags;
      sum += s.model.variance * static_cast<double>(s.row.size());
      total += static_cast<double>(s.row.size());
      effective += s.model.EffectiveCount();
      noise.smallest_p = std::min(noise.smallest_p, s.p_value);
      s.model.variance = std::max(s.model.variance, unit_variance);
      noise.series.push_back(std::move(s));
    }
  }
  if (total > 0.0) {
    noise.variance = sum / total;
    noise.effective_share = effective / total;
  }
  if (freedoms > 0.0) noise.p_together = ChiSquareTail(statistic, freedoms);
  noise.smallest_p = std::min(1.0, noise.smallest_p * static_cast<double>(noise.series.size()));
  return noise;
}

Eigen::MatrixXd ResidualNoise::Middle(const Eigen::MatrixXd& J) const {
  const Eigen::Index q = J.cols();
  Eigen::MatrixXd middle = Eigen::MatrixXd::Zero(q, q);
  for (const Series& s : series) {
    const auto n = static_cast<Eigen::Index>(s.row.size());
    Eigen::MatrixXd X(n, q), GX(n, q);
    for (Eigen::Index i = 0; i < n; ++i) X.row(i) = J.row(s.row[static_cast<std::size_t>(i)]);
    if (s.model.a.empty()) {
      middle.noalias() += s.model.variance * (X.transpose() * X);
      continue;
    }
    // G X, a Toeplitz product, by FFT on the mark's even grid.
    const std::size_t slots = s.slot.back() + 1;
    const std::size_t length = FastLength(2 * slots);
    const std::vector<double> rho = s.model.Correlation(slots - 1);
    std::vector<double> kernel(length, 0.0);
    for (std::size_t l = 0; l < slots; ++l) {
      kernel[l] = rho[l];
      if (l > 0) kernel[length - l] = rho[l];
    }
    const auto K = RealFft(kernel);
    std::vector<double> x(length);
    for (Eigen::Index c = 0; c < q; ++c) {
      std::fill(x.begin(), x.end(), 0.0);
      for (Eigen::Index i = 0; i < n; ++i) x[s.slot[static_cast<std::size_t>(i)]] = X(i, c);
      auto F = RealFft(x);
      for (std::size_t k = 0; k < F.size(); ++k) F[k] *= K[k];
      const std::vector<double> y = InverseRealFft(F, length);
      for (Eigen::Index i = 0; i < n; ++i) GX(i, c) = y[s.slot[static_cast<std::size_t>(i)]];
    }
    middle.noalias() += s.model.variance * (X.transpose() * GX);
  }
  return 0.5 * (middle + middle.transpose());
}

}  // namespace unfurl::correlate
