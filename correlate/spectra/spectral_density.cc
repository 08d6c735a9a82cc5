#include "correlate/spectra/spectral_density.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/error.h"
#include "base/statistics.h"
#include "correlate/spectra/fft.h"

namespace unfurl::correlate {

namespace {

constexpr std::size_t kFewestOfSegment = 8;  // samples of a segment

// "m^2"; "(m/s^2)^2" of a unit that is more than a name.
std::string SquaredUnit(const std::string& unit) {
  const bool compound = unit.find_first_of("^/ ") != std::string::npos;
  return compound ? "(" + unit + ")^2" : unit + "^2";
}

// Squared correlation of two segments' spectra whose windows overlap with `lag` samples' shift.
double OverlapCorrelation(std::span<const double> w, std::size_t lag) {
  double with = 0.0, all = 0.0;
  for (std::size_t i = 0; i < w.size(); ++i) {
    all += w[i] * w[i];
    if (i + lag < w.size()) with += w[i] * w[i + lag];
  }
  return (with / all) * (with / all);
}

std::size_t SegmentLength(const DensityOptions& options, std::size_t longest) {
  // Eight segments that overlap by half take four and a half lengths.
  const std::size_t n = options.segment != 0
                            ? options.segment
                            : static_cast<std::size_t>(static_cast<double>(longest) / 4.5);
  return std::clamp(n, kFewestOfSegment, longest);
}

// Adds the windowed periodograms of one segment of both signals.
void AddPeriodograms(std::span<const double> x, std::span<const double> y,
                     const std::vector<double>& w, Detrend detrend, CrossSpectrum* out) {
  std::vector<double> a = Detrended(x, detrend);
  std::vector<double> b = Detrended(y, detrend);
  for (std::size_t i = 0; i < w.size(); ++i) a[i] *= w[i], b[i] *= w[i];
  const auto A = RealFft(a), B = RealFft(b);
  for (std::size_t k = 0; k < out->xx.size(); ++k) {
    out->xx[k] += std::norm(A[k]);
    out->yy[k] += std::norm(B[k]);
    out->xy[k] += std::conj(A[k]) * B[k];
  }
}

// From sums over segments of n samples to single-sided densities; `squares`: of the window, times
// the segments.
void ScaleDensities(std::size_t n, double squares, CrossSpectrum* out) {
  for (std::size_t k = 0; k < out->xx.size(); ++k) {
    const bool alone = k == 0 || (n % 2 == 0 && k == n / 2);
    const double scale = (alone ? 1.0 : 2.0) * out->dt / (squares);
    out->frequency.push_back(static_cast<double>(k) * out->resolution);
    out->xx[k] *= scale;
    out->yy[k] *= scale;
    out->xy[k] *= scale;
    const double both = out->xx[k] * out->yy[k];
    out->coherence.push_back(both > 0.0 ? std::min(1.0, std::norm(out->xy[k]) / both) : 0.0);
  }
}

}  // namespace

CrossSpectrum WelchCrossSpectrum(std::span<const double> t, std::span<const double> x,
                                 std::span<const double> y, const std::string& unit,
                                 const DensityOptions& options) {
  const std::vector<EvenStretch> stretches = EvenStretches(t);
  std::size_t longest = 0;
  for (const EvenStretch& s : stretches) longest = std::max(longest, s.count);
  if (x.size() != t.size() || y.size() != t.size() || longest < kFewestOfSegment) {
    throw Error(fmt::format("densities of {} samples, {} without a gap", t.size(), longest),
                "spectrum", "give at least 8 evenly spaced samples of both signals");
  }
  const std::size_t n = SegmentLength(options, longest);
  const auto hop = std::max<std::size_t>(
      1, static_cast<std::size_t>(std::lround(static_cast<double>(n) * (1.0 - options.overlap))));
  const std::vector<double> w = WindowValues(options.window, n);
  double square = 0.0;
  for (const double v : w) square += v * v;

  CrossSpectrum out;
  const std::size_t bins = n / 2 + 1;
  out.xx.assign(bins, 0.0);
  out.yy.assign(bins, 0.0);
  out.xy.assign(bins, 0.0);
  double correlated = 0.0, total_dt = 0.0;
  for (const EvenStretch& s : stretches) {
    std::size_t own = 0;
    for (std::size_t from = 0; from + n <= s.count; from += hop, ++own) {
      AddPeriodograms(x.subspan(s.first + from, n), y.subspan(s.first + from, n), w,
                      options.detrend, &out);
      total_dt += s.dt;
    }
    for (std::size_t r = 1; r < own; ++r) {
      correlated += 2.0 * static_cast<double>(own - r) * OverlapCorrelation(w, r * hop);
    }
    out.segments += own;
  }
  const auto count = static_cast<double>(out.segments);
  out.dt = total_dt / count;
  // Variance of a mean of correlated terms [Welch 1967].
  out.effective_segments = count * count / (count + correlated);
  out.resolution = 1.0 / (static_cast<double>(n) * out.dt);
  out.noise_bandwidth = NoiseBandwidth(options.window) * out.resolution;
  ScaleDensities(n, square * count, &out);
  if (out.effective_segments > 1.0) {
    out.no_coherence = 1.0 - std::pow(0.05, 1.0 / (out.effective_segments - 1.0));
  }
  out.convention = fmt::format(
      "single-sided power spectral density in {0}/Hz (its integral is the variance); {1} "
      "segments "
      "of {2} samples every {3:.4g} s, overlapping by {4:.0f}%, worth {5:.1f} independent ones; "
      "{6} "
      "of each, {7} window; bins {8:.4g} Hz apart, noise bandwidth {9:.4g} Hz; {10}",
      SquaredUnit(unit), out.segments, n, out.dt,
      100.0 * (1.0 - static_cast<double>(hop) / static_cast<double>(n)), out.effective_segments,
      Name(options.detrend), Name(options.window), out.resolution, out.noise_bandwidth,
      out.segments > 1 ? fmt::format("unrelated noise shows a coherence above {:.2f} in one bin of "
                                     "twenty",
                                     out.no_coherence)
                       : std::string("a coherence from one segment is 1 and says nothing"));
  return out;
}

namespace {

// Left of each bin, the lowest on the way to the next that is higher, and where it is; each bin is
// put on the stack and taken from it once.
struct Valley {
  double low = std::numeric_limits<double>::infinity();
  std::size_t at = 0;
};
std::vector<Valley> ValleysBefore(std::span<const double> s) {
  std::vector<Valley> out(s.size());
  std::vector<std::size_t> higher;
  for (std::size_t k = 0; k < s.size(); ++k) {
    Valley& v = out[k];
    v.at = k;
    while (!higher.empty() && s[higher.back()] <= s[k]) {
      const std::size_t j = higher.back();
      if (s[j] < v.low) v = {s[j], j};
      if (out[j].low < v.low) v = out[j];
      higher.pop_back();
    }
    higher.push_back(k);
  }
  return out;
}

// The top of a parabola through three logarithms, in bins from the middle one.
double TopOfParabola(double before, double at, double after) {
  if (!(std::min(before, after) > 0.0)) return 0.0;
  const double a = std::log(before), b = std::log(at), c = std::log(after);
  const double bend = a - 2.0 * b + c;
  return bend < 0.0 ? std::clamp(0.5 * (a - c) / bend, -0.5, 0.5) : 0.0;
}

}  // namespace

std::vector<Peak> FindDensityPeaks(std::span<const double> density, const CrossSpectrum& of,
                                   int most) {
  constexpr double kChance = 0.05;   // of a false peak in a spectrum
  constexpr std::size_t kFirst = 2;  // bins before it hold what detrending left
  std::vector<Peak> peaks;
  if (density.size() < kFirst + 3 || of.effective_segments <= 1.0) return peaks;
  const auto s = density.subspan(kFirst);
  const std::vector<double> mirrored(s.rbegin(), s.rend());
  const std::vector<Valley> left = ValleysBefore(s), right = ValleysBefore(mirrored);
  const auto n = static_cast<double>(s.size());
  const double freedom = 2.0 * of.effective_segments;
  const double stands_out = FisherQuantile(1.0 - kChance / (0.5 * n * (n - 1.0)), freedom, freedom);
  for (std::size_t k = 1; k + 1 < s.size(); ++k) {
    if (s[k] <= s[k - 1] || s[k] < s[k + 1]) continue;
    const Valley &a = left[k], &b = right[s.size() - 1 - k];
    if (!(s[k] > stands_out * std::max(a.low, b.low))) continue;
    double square = 0.0;
    for (std::size_t i = a.at; i <= s.size() - 1 - b.at; ++i) square += s[i] * of.resolution;
    Peak peak;
    peak.bin = k + kFirst;
    peak.frequency =
        (static_cast<double>(peak.bin) + TopOfParabola(s[k - 1], s[k], s[k + 1])) * of.resolution;
    peak.amplitude = std::sqrt(square);
    peaks.push_back(peak);
  }
  std::stable_sort(peaks.begin(), peaks.end(),
                   [](const Peak& x, const Peak& y) { return x.amplitude > y.amplitude; });
  if (peaks.size() > static_cast<std::size_t>(most)) peaks.resize(static_cast<std::size_t>(most));
  return peaks;
}

double FrequencyResponseAssurance(std::span<const std::complex<double>> a,
                                  std::span<const std::complex<double>> b) {
  std::complex<double> ab = 0.0;
  double aa = 0.0, bb = 0.0;
  for (std::size_t k = 0; k < std::min(a.size(), b.size()); ++k) {
    ab += a[k] * std::conj(b[k]);
    aa += std::norm(a[k]);
    bb += std::norm(b[k]);
  }
  return aa > 0.0 && bb > 0.0 ? std::norm(ab) / (aa * bb) : 0.0;
}

std::complex<double> FourierAmplitude(std::span<const double> t, std::span<const double> x,
                                      double frequency, double t_ref) {
  const std::size_t n = t.size();
  if (n < 2) return 0.0;
  // The line and the window by the stamps themselves: they need not be even.
  double st = 0.0, sx = 0.0;
  for (std::size_t i = 0; i < n; ++i) st += t[i], sx += x[i];
  st /= static_cast<double>(n);
  sx /= static_cast<double>(n);
  double tt = 0.0, tx = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    tt += (t[i] - st) * (t[i] - st);
    tx += (t[i] - st) * (x[i] - sx);
  }
  const double slope = tt > 0.0 ? tx / tt : 0.0;
  const double step = (t[n - 1] - t[0]) / static_cast<double>(n - 1);
  const double length = static_cast<double>(n) * step;
  std::complex<double> sum = 0.0;
  double weights = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const double w = 0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * (t[i] - t[0]) / length);
    weights += w;
    sum += w * (x[i] - sx - slope * (t[i] - st)) *
           std::polar(1.0, -2.0 * std::numbers::pi * frequency * (t[i] - t_ref));
  }
  return weights > 0.0 ? 2.0 * sum / weights : 0.0;
}

}  // namespace unfurl::correlate
