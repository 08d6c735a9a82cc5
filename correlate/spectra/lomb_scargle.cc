#include "correlate/spectra/lomb_scargle.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "base/dense.h"
#include "base/error.h"
#include "correlate/sampled_model.h"
#include "correlate/spectra/nonuniform_fft.h"

namespace unfurl::correlate {

namespace {

// 1 / sigma^2, or all alike, that add up to 1.
std::vector<double> Weights(std::span<const double> sigma, std::size_t n) {
  std::vector<double> w(n, 1.0);
  if (sigma.size() == n) {
    for (std::size_t i = 0; i < n; ++i) w[i] = 1.0 / (sigma[i] * sigma[i]);
  }
  double total = 0.0;
  for (const double v : w) total += v;
  for (double& v : w) v /= total;
  return w;
}

// What a straight line by the same weights leaves.
std::vector<double> WithoutLine(std::span<const double> t, std::span<const double> x,
                                const std::vector<double>& w) {
  const std::size_t n = t.size();
  double mt = 0.0, mx = 0.0;
  for (std::size_t i = 0; i < n; ++i) mt += w[i] * t[i], mx += w[i] * x[i];
  double tt = 0.0, tx = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    tt += w[i] * (t[i] - mt) * (t[i] - mt);
    tx += w[i] * (t[i] - mt) * (x[i] - mx);
  }
  std::vector<double> y(n);
  for (std::size_t i = 0; i < n; ++i) y[i] = x[i] - mx - tx / tt * (t[i] - mt);
  return y;
}

}  // namespace

// [Zechmeister and Kuerster 2009]: weights and a constant fitted beside the sine.
LombSpectrum LombScargle(std::span<const double> t, std::span<const double> x,
                         std::span<const double> sigma, const std::string& unit,
                         const LombOptions& options) {
  const std::size_t n = t.size();
  if (n < 8 || x.size() != n || !(t.back() > t.front())) {
    throw Error(fmt::format("a periodogram of {} samples", n), "spectrum",
                "give at least 8 samples at rising stamps");
  }
  const std::vector<double> w = Weights(sigma, n);
  const std::vector<double> y = WithoutLine(t, x, w);
  double yy = 0.0;
  for (std::size_t i = 0; i < n; ++i) yy += w[i] * y[i] * y[i];

  // Below, cosine and sine are one column at these stamps; the sums are good to some 1e-12.
  constexpr double kOneColumn = 1e-9;
  LombSpectrum out;
  out.n = n;
  const double duration = t.back() - t.front();
  out.resolution = 1.0 / duration;
  const double low = options.low > 0.0 ? options.low : out.resolution;
  const double high = options.high > 0.0 ? options.high : 0.5 / MedianStep(t);
  const double step = out.resolution / std::max(1, options.oversample);
  std::size_t count = 0;
  while (low + static_cast<double>(count) * step <= high) ++count;
  // sum w y exp(i w t), sum w exp(i w t), and sum w exp(2 i w t), from which the squares come.
  const auto sums = [&](std::span<const double> values, double times) {
    std::vector<double> phase(n);
    std::vector<std::complex<double>> term(n);
    for (std::size_t i = 0; i < n; ++i) {
      const double turns = times * (t[i] - t[0]);
      phase[i] = 2.0 * std::numbers::pi * step * turns;
      term[i] = std::polar(values[i], 2.0 * std::numbers::pi * low * turns);
    }
    return NonuniformFft(phase, term, count);
  };
  std::vector<double> wy(n);
  for (std::size_t i = 0; i < n; ++i) wy[i] = w[i] * y[i];
  const auto signal = sums(wy, 1.0), weight = sums(w, 1.0), twice = sums(w, 2.0);
  for (std::size_t k = 0; k < count; ++k) {
    const double f = low + static_cast<double>(k) * step;
    const double c = weight[k].real(), s = weight[k].imag();
    const double cc = 0.5 * (1.0 + twice[k].real()), cs = 0.5 * twice[k].imag();
    const double yc = signal[k].real(), ys = signal[k].imag();
    // About the fitted constant; y has weighted mean zero.
    const double CC = cc - c * c, SS = 1.0 - cc - s * s, CS = cs - c * s;
    const double D = CC * SS - CS * CS;
    double a = 0.0, b = 0.0;
    if (D > kOneColumn) {
      a = (SS * yc - CS * ys) / D;
      b = (CC * ys - CS * yc) / D;
    }
    out.frequency.push_back(f);
    out.amplitude.push_back(std::hypot(a, b));
    out.power.push_back(yy > 0.0 ? std::clamp((a * yc + b * ys) / yy, 0.0, 1.0) : 0.0);
  }
  out.convention = fmt::format(
      "amplitude in {} of the sine that fits best at each frequency, beside a constant "
      "(Lomb-Scargle, "
      "no window); {} samples at their own stamps over {:.4g} s, gaps left as they are, a straight "
      "line taken out; peaks nearer than {:.4g} Hz are not told apart",
      unit, n, duration, out.resolution);
  return out;
}

namespace {

struct Highest {
  double frequency = 0.0;
  double chance = 1.0;
};

Highest HighestOf(const LombSpectrum& s) {
  Highest out;
  if (s.power.size() < 3) return out;
  const std::size_t k = static_cast<std::size_t>(
      std::max_element(s.power.begin() + 1, s.power.end() - 1) - s.power.begin());
  // So many independent frequencies; each power is a beta variable where there is only noise.
  const double band = (s.frequency.back() - s.frequency.front()) / s.resolution + 1.0;
  const double single = std::pow(1.0 - s.power[k], 0.5 * (static_cast<double>(s.n) - 4.0));
  out.chance = -std::expm1(band * std::log1p(-std::min(single, 1.0 - 1e-16)));
  const double before = s.power[k - 1], at = s.power[k], after = s.power[k + 1];
  const double bend = before - 2.0 * at + after;
  const double shift = bend < 0.0 ? std::clamp(0.5 * (before - after) / bend, -1.0, 1.0) : 0.0;
  out.frequency = s.frequency[k] + shift * (s.frequency[k + 1] - s.frequency[k]);
  return out;
}

// All sines at once, beside a straight line. `without`: which one the residual keeps; -1: none.
std::vector<double> TakeOut(std::span<const double> t, std::span<const double> x,
                            std::span<const double> sigma, int without,
                            std::vector<LombPeak>* peaks) {
  const auto n = static_cast<Eigen::Index>(t.size());
  const auto count = static_cast<Eigen::Index>(peaks->size());
  Eigen::MatrixXd basis(n, 2 + 2 * count);
  Eigen::VectorXd y(n), w = Eigen::VectorXd::Ones(n);
  const double middle = 0.5 * (t.front() + t.back()), half = 0.5 * (t.back() - t.front());
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (sigma.size() == t.size()) w(i) = 1.0 / sigma[k];
    y(i) = x[k];
    basis(i, 0) = 1.0;
    basis(i, 1) = (t[k] - middle) / half;
    for (Eigen::Index j = 0; j < count; ++j) {
      const double phase = 2.0 * std::numbers::pi *
                           (*peaks)[static_cast<std::size_t>(j)].frequency * (t[k] - middle);
      basis(i, 2 + 2 * j) = std::cos(phase);
      basis(i, 3 + 2 * j) = std::sin(phase);
    }
  }
  Eigen::VectorXd c = (w.asDiagonal() * basis).householderQr().solve(w.cwiseProduct(y));
  for (Eigen::Index j = 0; j < count; ++j) {
    (*peaks)[static_cast<std::size_t>(j)].amplitude = std::hypot(c(2 + 2 * j), c(3 + 2 * j));
  }
  if (without >= 0) c.segment<2>(2 + 2 * without).setZero();
  const Eigen::VectorXd left = y - basis * c;
  return {left.data(), left.data() + n};
}

}  // namespace

std::vector<LombPeak> FindLombPeaks(std::span<const double> t, std::span<const double> x,
                                    std::span<const double> sigma, const LombOptions& options,
                                    int most) {
  constexpr double kChance = 0.01;  // probability of a peak as high in white noise [-]
  constexpr int kSweeps = 2;        // over all sines, each with the others taken out
  std::vector<LombPeak> peaks;
  std::vector<double> left(x.begin(), x.end());
  while (static_cast<int>(peaks.size()) < most) {
    const Highest next = HighestOf(LombScargle(t, left, sigma, "1", options));
    if (next.chance > kChance) break;
    const double least = 1.0 / (t.back() - t.front());
    const bool known = std::any_of(peaks.begin(), peaks.end(), [&](const LombPeak& p) {
      return std::abs(p.frequency - next.frequency) < least;
    });
    if (known) break;  // what is left there is not a sine: a decay's flank
    peaks.push_back({next.frequency, 0.0, next.chance});
    left = TakeOut(t, x, sigma, -1, &peaks);
  }
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (std::size_t j = 0; j < peaks.size(); ++j) {
      const std::vector<double> own = TakeOut(t, x, sigma, static_cast<int>(j), &peaks);
      LombOptions near = options;
      const double reach = 1.0 / (t.back() - t.front());
      near.low = std::max(0.1 * reach, peaks[j].frequency - reach);
      near.high = peaks[j].frequency + reach;
      near.oversample = 20;
      peaks[j].frequency = HighestOf(LombScargle(t, own, sigma, "1", near)).frequency;
    }
  }
  if (!peaks.empty()) TakeOut(t, x, sigma, -1, &peaks);
  std::stable_sort(peaks.begin(), peaks.end(),
                   [](const LombPeak& a, const LombPeak& b) { return a.amplitude > b.amplitude; });
  return peaks;
}

}  // namespace unfurl::correlate
