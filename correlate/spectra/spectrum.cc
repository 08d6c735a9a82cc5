#include "correlate/spectra/spectrum.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/statistics.h"
#include "correlate/sampled_model.h"
#include "correlate/spectra/fft.h"

namespace unfurl::correlate {

std::vector<double> Detrended(std::span<const double> x, Detrend how) {
  std::vector<double> out(x.begin(), x.end());
  if (how == Detrend::kNone) return out;
  const auto n = static_cast<double>(x.size());
  const double middle = 0.5 * (n - 1.0);
  double mean = 0.0, slope = 0.0, spread = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double u = static_cast<double>(i) - middle;
    mean += x[i] / n;
    slope += u * x[i];
    spread += u * u;
  }
  slope = how == Detrend::kLine && spread > 0.0 ? slope / spread : 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    out[i] -= mean + slope * (static_cast<double>(i) - middle);
  }
  return out;
}

const char* Name(Detrend how) {
  switch (how) {
    case Detrend::kNone:
      return "no trend taken out";
    case Detrend::kMean:
      return "the mean taken out";
    case Detrend::kLine:
      return "a straight line taken out";
  }
  return "";
}

Spectrum AmplitudeSpectrum(std::span<const double> x, double dt, const std::string& unit,
                           const SpectrumOptions& options) {
  const std::size_t n = x.size();
  if (n < 8 || !(dt > 0.0)) {
    throw Error(fmt::format("a spectrum of {} samples at a step of {} s", n, dt), "spectrum",
                "give at least 8 evenly spaced samples");
  }
  std::vector<double> y = Detrended(x, options.detrend);
  double sum = 0.0, square = 0.0;
  const std::vector<double> window = WindowValues(options.window, n);
  for (std::size_t i = 0; i < n; ++i) {
    y[i] *= window[i];
    sum += window[i];
    square += window[i] * window[i];
  }
  const auto X = RealFft(y);
  Spectrum out;
  out.n = n;
  out.dt = dt;
  out.window = options.window;
  out.resolution = 1.0 / (static_cast<double>(n) * dt);
  out.noise_bandwidth = out.resolution * static_cast<double>(n) * square / (sum * sum);
  for (std::size_t k = 0; k < X.size(); ++k) {
    // Bins with a mirror image at a negative frequency carry both; 0 and Nyquist have none.
    const bool alone = k == 0 || (n % 2 == 0 && k == n / 2);
    out.frequency.push_back(static_cast<double>(k) * out.resolution);
    out.value.push_back((alone ? 1.0 : 2.0) / sum * X[k]);
    out.amplitude.push_back(std::abs(out.value.back()));
  }
  out.convention = fmt::format(
      "single-sided amplitude in {} (a sine of amplitude A shows as A); {} samples every {:.4g} s, "
      "{}, {} window with its gain of {:.3g} divided out; bins {:.4g} Hz apart, noise bandwidth "
      "{:.4g} Hz",
      unit, n, dt, Name(options.detrend), Name(options.window), sum / static_cast<double>(n),
      out.resolution, out.noise_bandwidth);
  return out;
}

namespace {

// The median amplitude around each bin, a quarter of the band wide: taken at anchors a 64th of the
// band apart, each bin's the nearest one's, so that a spectrum of n bins costs 16 n.
class NoiseFloor {
 public:
  explicit NoiseFloor(std::span<const double> amplitude)
      : spacing_(std::max<std::size_t>(1, amplitude.size() / 64)) {
    const std::size_t n = amplitude.size(), reach = std::max<std::size_t>(8, n / 8);
    for (std::size_t at = spacing_ / 2; at < n; at += spacing_) {
      const std::size_t from = at > reach ? at - reach : 0, to = std::min(n, at + reach + 1);
      median_.push_back(Median(amplitude.subspan(from, to - from)));
    }
  }
  double At(std::size_t bin) const { return median_[std::min(bin / spacing_, median_.size() - 1)]; }

 private:
  std::size_t spacing_;  // bins
  std::vector<double> median_;
};

}  // namespace

std::vector<Peak> FindPeaks(const Spectrum& s, const PeakOptions& options) {
  std::vector<Peak> peaks;
  const std::size_t n = s.amplitude.size();
  if (n < 5) return peaks;
  constexpr std::size_t kFirst = 2;  // bins before it hold what detrending left
  const NoiseFloor floor(s.amplitude);
  double largest = 0.0;
  for (std::size_t k = kFirst; k + 1 < n; ++k) {
    if (s.frequency[k] < options.low) continue;
    const double c = s.amplitude[k];
    if (c < s.amplitude[k - 1] || c <= s.amplitude[k + 1]) continue;
    if (c < options.over_floor * floor.At(k)) continue;
    // The larger neighbour tells where between the bins the sine lies.
    const bool up = s.amplitude[k + 1] >= s.amplitude[k - 1];
    const double ratio = (up ? s.amplitude[k + 1] : s.amplitude[k - 1]) / c;
    const double delta = BinOffset(s.window, ratio);
    Peak peak;
    peak.bin = k;
    peak.frequency = (static_cast<double>(k) + (up ? delta : -delta)) * s.resolution;
    peak.amplitude = c / WindowResponse(s.window, delta);
    largest = std::max(largest, peak.amplitude);
    peaks.push_back(peak);
  }
  std::erase_if(peaks, [&](const Peak& p) { return p.amplitude < options.over_largest * largest; });
  std::stable_sort(peaks.begin(), peaks.end(),
                   [](const Peak& x, const Peak& y) { return x.amplitude > y.amplitude; });
  if (peaks.size() > static_cast<std::size_t>(options.most)) {
    peaks.resize(static_cast<std::size_t>(options.most));
  }
  return peaks;
}

std::vector<PeakPair> PairPeaks(const std::vector<Peak>& a, const std::vector<Peak>& b,
                                double resolution, double bins) {
  struct Candidate {
    double distance;
    int a, b;
  };
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < b.size(); ++j) {
      const double d = std::abs(a[i].frequency - b[j].frequency);
      if (d <= bins * resolution) {
        candidates.push_back({d, static_cast<int>(i), static_cast<int>(j)});
      }
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& x, const Candidate& y) { return x.distance < y.distance; });
  std::vector<int> partner_a(a.size(), -1), partner_b(b.size(), -1);
  for (const Candidate& c : candidates) {
    auto& pa = partner_a[static_cast<std::size_t>(c.a)];
    auto& pb = partner_b[static_cast<std::size_t>(c.b)];
    if (pa >= 0 || pb >= 0) continue;
    pa = c.b;
    pb = c.a;
  }
  std::vector<PeakPair> out;
  for (std::size_t i = 0; i < a.size(); ++i) out.push_back({static_cast<int>(i), partner_a[i]});
  for (std::size_t j = 0; j < b.size(); ++j) {
    if (partner_b[j] < 0) out.push_back({-1, static_cast<int>(j)});
  }
  return out;
}

std::vector<EvenStretch> EvenStretches(std::span<const double> t) {
  std::vector<EvenStretch> out;
  const double dt = MedianStep(t);
  std::size_t first = 0;
  for (std::size_t i = 1; i <= t.size() && !t.empty(); ++i) {
    const bool even = i < t.size() && std::abs(t[i] - t[i - 1] - dt) <= 0.01 * dt;
    if (even) continue;
    EvenStretch s{first, i - first, dt, i - first == t.size()};
    if (s.count > 1) {  // the mean step within it, free of the jitter of single stamps
      s.dt = (t[i - 1] - t[first]) / static_cast<double>(s.count - 1);
    }
    out.push_back(s);
    first = i;
  }
  return out;
}

EvenStretch LongestEvenStretch(std::span<const double> t) {
  EvenStretch best;
  best.dt = MedianStep(t);
  for (const EvenStretch& s : EvenStretches(t)) {
    if (s.count > best.count) best = s;
  }
  return best;
}

}  // namespace unfurl::correlate
