#include "measure/spot.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "measure/float_pack.h"
#include "measure/spot_fit.h"

namespace unfurl::measure {

namespace {

constexpr int kSpotMargin = 5;       // pixels of background on either side of a spot
constexpr double kSpotReach = 2.45;  // widths at which a Gaussian has fallen to a twentieth
constexpr double kInside = 2.0;      // widths from the edge that a whole spot keeps

// m[k] = a[k - step] + a[k] + a[k + step], where all three exist; the ends repeat the outermost.
void SumOfThree(const float* a, int n, int step, int ready, float* m) {
  const int first = ready + step, last = n - 1 - ready - step;
  for (int k = first; k <= last; ++k) m[k] = (a[k - step] + a[k + step]) + a[k];
  // Spots cut by an edge still have a foot inside; let the outermost sums tell.
  for (int k = 0; k < first; ++k) m[k] = m[first];
  for (int k = last + 1; k < n; ++k) m[k] = m[last];
}

// What a fit takes in beyond the foot: dim hills end in the noise before their light does.
int Margin(const SpotPeak& peak) {
  const double half = 0.5 * (peak.high - peak.low);
  const double fallen = std::sqrt(2.0 * std::log(1.0 / peak.foot));
  return kSpotMargin + static_cast<int>(std::max(0.0, (kSpotReach / fallen - 1.0) * half));
}

// Centre and width of a peak by the moments of its light: where the fit begins.
Spot GuessOf(const SpotPeak& p, const float* d) {
  Spot spot;
  spot.flags = 0;
  double sum = 0.0, by_k = 0.0, by_square = 0.0;
  for (int k = p.low; k <= p.high; ++k) {
    const double light = std::max(0.0F, d[k]);
    const double at = k - p.summit;
    sum += light;
    by_k += light * at;
    by_square += light * at * at;
  }
  const double mean = by_k / sum;
  spot.flux = sum;  // where the fit fails, too: what is beside it is then known to be fainter
  spot.u_px = p.summit + mean;
  spot.width_px = std::sqrt(std::max(0.3, by_square / sum - mean * mean));
  return spot;
}

// Of spots that were fitted together and failed, those beside light that is too wide to be one: the
// edge of a blind's shadow, say, which the baseline's sections are too long to follow, and which no
// Gaussian fits. Over a spot's width that light is level, so it is fitted by itself. `window` and
// `signal` are of the row's pixels, `from` and `to` the ends of the window.
void FitOnLight(std::span<const SpotPeak> peaks, const float* signal, const float* window, int from,
                int to, double widest, const PixelNoise& noise, const SpotOptions& options,
                std::span<Spot> spots) {
  if (!(widest > 0.0)) return;
  const auto wide = [&](std::size_t i) { return GuessOf(peaks[i], signal).width_px > widest; };
  for (std::size_t i = 0; i < spots.size(); ++i) {
    if ((spots[i].flags & kSpotPoorFit) == 0 || wide(i)) continue;
    const bool beside_spot = (i > 0 && !wide(i - 1)) || (i + 1 < spots.size() && !wide(i + 1));
    if (beside_spot) continue;
    const int low = std::max(from, peaks[i].low - kSpotMargin);
    const int high = std::min(to, peaks[i].high + kSpotMargin);
    Spot alone = GuessOf(peaks[i], signal);
    alone.flags = static_cast<std::uint8_t>(spots[i].flags & ~kSpotPoorFit);
    FitGaussian({window + low, static_cast<std::size_t>(high - low + 1)}, low, noise, options,
                &alone);
    spots[i] = alone;
  }
}

// A pixel that is full before it is read, as it is where the converter's range ends with the well,
// is read with the read noise: four sigmas below full scale in 3 of 100,000.
int FullFrom(const data::LineFormat& format) {
  constexpr double kSigmas = 4.0;  // of the read noise, as above [-]
  const double full = format.full_scale();
  return static_cast<int>(
      std::ceil(std::max(0.5 * full, full - kSigmas * format.read_noise_counts)));
}

}  // namespace

SpotFinder::SpotFinder(const data::LineFormat& format, const SpotOptions& options)
    : format_(format),
      options_(options),
      signal_(static_cast<std::size_t>(format.active)),
      sums_(signal_.size()),
      scratch_(signal_.size()),
      window_(signal_.size()),
      full_(FullFrom(format)) {
  peaks_.reserve(64);
}

void SpotFinder::SetResponse(std::span<const float> response) {
  inverse_response_.clear();
  for (const float r : response) inverse_response_.push_back(1.0F / r);
}

void SetResponses(std::span<const float> response, std::span<SpotFinder> finders) {
  std::size_t first = 0;
  for (SpotFinder& finder : finders) {
    const auto active = static_cast<std::size_t>(finder.format().active);
    finder.SetResponse(response.empty() ? response : response.subspan(first, active));
    first += active;
  }
}

// What the room's light, or the sensor's level, has changed by since the dark lines, with its shape
// along the row: medians of block means, section by section, joined by straight pieces. A spot
// whose sigma is half a block has fallen to 3e-4 two blocks away, so that it moves no median; wider
// ones are no readings where something was subtracted. The line itself tells, so nothing is
// believed of how fast light changes; what is left is the medians' own error, a thirteenth of a
// pixel's noise.
void SpotFinder::SubtractBaseline(float sigma) {
  constexpr int kPerSection = 9;     // blocks whose median counts
  constexpr int kMostSections = 64;  // fixed, so that nothing is allocated; 17,280 px side by side
  constexpr float kTells = 3.0F;     // sigmas of a section's median: below, it would only add noise
  constexpr double kWidest = 0.5;    // sigma of a spot, over a block
  widest_ = 0.0;
  const int n = format_.active;
  // Six sums of five; fewer on rows too short for one such section.
  const int fives = std::clamp(n / (5 * kPerSection), 0, 6);
  if (fives < 1) return;
  const int block = 5 * fives, width = block * kPerSection;
  const int sections = std::min(kMostSections, n / width);
  const float* m = sums_.data();
  float level[kMostSections];
  bool tells = false;
  const float error = sigma * std::sqrt(1.571F / static_cast<float>(width));
  // Where the row holds more than kMostSections, they lie evenly spread.
  const float pitch = static_cast<float>(n) / static_cast<float>(sections);
  for (int s = 0; s < sections; ++s) {
    const int first = static_cast<int>(static_cast<float>(s) * pitch);
    float mean[kPerSection];
    for (int b = 0; b < kPerSection; ++b) {
      const float* five = m + first + b * block + 2;
      float sum = 0.0F;
      for (int i = 0; i < fives; ++i) sum += five[5 * i];
      mean[b] = sum / static_cast<float>(block);
    }
    std::nth_element(mean, mean + kPerSection / 2, mean + kPerSection);
    level[s] = mean[kPerSection / 2];
    tells |= std::abs(level[s]) > kTells * error;
  }
  if (!tells) return;
  widest_ = kWidest * block;
  const float half = 0.5F * static_cast<float>(width);
  const auto at = [&](int k) { return (static_cast<float>(k) + 0.5F - half) / pitch; };
  // From the middle of one section to that of the next, so that the compiler takes many at once.
  for (int left = 0, k = 0; k < n; ++left) {
    const int right = std::min(left + 1, sections - 1);
    int end = n;
    if (left + 2 < sections) {
      const auto next = static_cast<float>(left + 1);
      end = std::clamp(static_cast<int>(next * pitch + half - 0.5F), k, n);
      while (end < n && at(end) < next) ++end;
      while (end > k && at(end - 1) >= next) --end;
    }
    const float low = level[left], rise = level[right] - low, from = static_cast<float>(left);
    float* d = signal_.data();
    float* sums = sums_.data();
    for (; k < end; ++k) {
      const float b = low + std::clamp(at(k) - from, 0.0F, 1.0F) * rise;
      d[k] -= b;
      sums[k] -= 5.0F * b;
    }
  }
}

bool SpotFinder::Detect(std::span<const std::uint16_t> line, const Background& background) {
  const int n = format_.active;
  const std::uint16_t* counts = line.data() + format_.first_active();
  const float* mean = background.mean().data();
  const std::array<float, 2> level = background.Levels(line);
  float* d = signal_.data();
  float* m = sums_.data();
  int k = 0;
  const FloatPack levels = InTurn(level[0], level[1]);
  for (; k + kFloats <= n; k += kFloats) Store(Load(counts + k) - Load(mean + k) - levels, d + k);
  for (; k < n; ++k) d[k] = static_cast<float>(counts[k]) - mean[k] - level[k & 1];
  for (k = 2; k + 2 + kFloats <= n; k += kFloats) {
    Store((Load(d + k - 2) + Load(d + k - 1)) + (Load(d + k + 1) + Load(d + k + 2)) + Load(d + k),
          m + k);
  }
  for (; k < n - 2; ++k) m[k] = (d[k - 2] + d[k - 1]) + (d[k + 1] + d[k + 2]) + d[k];
  m[0] = m[1] = m[2];
  m[n - 1] = m[n - 2] = m[n - 3];

  const double modelled = std::sqrt(format_.read_noise_counts * format_.read_noise_counts +
                                    1.0 / 12.0);  // quantisation
  const double sigma = std::max(modelled, background.noise());
  dark_variance_ = sigma * sigma * (1.0 + background.mean_variance());
  SubtractBaseline(static_cast<float>(sigma));

  const auto rule = [&](double values) {
    return PeakRule{
        .threshold = static_cast<float>(options_.threshold * std::sqrt(values * dark_variance_)),
        .variance = static_cast<float>(values * dark_variance_),
        .gain = static_cast<float>(format_.electrons_per_count)};
  };
  FindPeaks(sums_, rule(5.0), &peaks_);
  // A wide dim spot stands out of wider sums only.
  if (peaks_.empty() && n > 64) {
    SumOfThree(m, n, 5, 2, scratch_.data());
    FindPeaks(scratch_, rule(15.0), &peaks_);
    if (!peaks_.empty()) std::swap(sums_, scratch_);
  }
  return !peaks_.empty();
}

double SpotFinder::LeastFlux(double width_px) const {
  // The share of its light in the five pixels of its middle.
  const double share = std::erf(2.5 / (M_SQRT2 * std::max(width_px, 1e-3)));
  return options_.threshold * std::sqrt(5.0 * dark_variance_) / share;
}

std::size_t SpotFinder::GroupEnd(std::size_t first) const {
  std::size_t last = first + 1;
  while (last < peaks_.size() && last - first < kMostJoint &&
         (peaks_[last - 1].touches_next || peaks_[last - 1].high + Margin(peaks_[last - 1]) >=
                                               peaks_[last].low - Margin(peaks_[last]))) {
    ++last;
  }
  return last;
}

void SpotFinder::Read(std::span<const std::uint16_t> line, std::size_t first, std::size_t last,
                      std::span<Spot> spots) {
  const int n = format_.active;
  float* w = window_.data();
  for (std::size_t i = first; i < last; ++i) {
    Spot& spot = spots[i - first];
    spot = GuessOf(peaks_[i], signal_.data());
    const bool overlaps = peaks_[i].touches_next || (i > 0 && peaks_[i - 1].touches_next);
    if (overlaps) spot.flags |= kSpotOverlap;
  }
  // A chain too long for one fit is cut where its spots meet.
  const bool cut_left = first > 0 && peaks_[first - 1].touches_next;
  const bool cut_right = peaks_[last - 1].touches_next;
  const int from = std::max(0, peaks_[first].low - (cut_left ? 0 : Margin(peaks_[first])));
  const int to =
      std::min(n - 1, peaks_[last - 1].high + (cut_right ? 0 : Margin(peaks_[last - 1])));
  FillWindow(line, from, to, first, spots);
  const PixelNoise noise{.electrons_per_count = format_.electrons_per_count,
                         .dark_variance = dark_variance_};
  if (Fits()) {
    FitGaussians({w + from, static_cast<std::size_t>(to - from + 1)}, from, noise, options_, spots);
    FitOnLight({&peaks_[first], spots.size()}, signal_.data(), w, from, to, widest_, noise,
               options_, spots);
  } else {
    for (std::size_t i = first; i < last; ++i) {
      const int low = std::max(from, peaks_[i].low - kSpotMargin);
      const int high = std::min(to, peaks_[i].high + kSpotMargin);
      ReadCentroid({w + low, static_cast<std::size_t>(high - low + 1)}, low, noise, options_,
                   &spots[i - first]);
    }
  }
  for (Spot& spot : spots) {
    if (spot.u_px < kInside * spot.width_px || spot.u_px > n - 1 - kInside * spot.width_px) {
      spot.flags |= kSpotEdge;
    }
    if (widest_ > 0.0 && spot.width_px > widest_) spot.flags |= kSpotPoorFit;
  }
}

bool SpotFinder::Fits() const {
  return options_.estimator == SpotEstimator::kMaximumLikelihood ||
         options_.estimator == SpotEstimator::kLeastSquares;
}

void SpotFinder::FillWindow(std::span<const std::uint16_t> line, int from, int to,
                            std::size_t first, std::span<Spot> spots) {
  const std::uint16_t* counts = line.data() + format_.first_active();
  const float* d = signal_.data();
  float* w = window_.data();
  const bool fits = Fits();
  std::copy(d + from, d + to + 1, w + from);
  for (int k = from; k <= to && !inverse_response_.empty(); ++k) {
    w[k] *= inverse_response_[static_cast<std::size_t>(k)];
  }
  for (int k = from; k <= to; ++k) {
    if (counts[k] < full_) continue;
    for (std::size_t i = 0; i < spots.size(); ++i) {
      const SpotPeak& peak = peaks_[first + i];
      if (k >= peak.low && k <= peak.high) spots[i].flags |= kSpotSaturated;
    }
    // The neighbours of full pixels may hold what these could not.
    for (int j = std::max(from, k - 1); fits && j <= std::min(to, k + 1); ++j) {
      w[j] = std::numeric_limits<float>::quiet_NaN();
    }
  }
}

std::size_t SpotFinder::FindAll(std::span<const std::uint16_t> line, const Background& background,
                                std::span<Spot> spots) {
  if (spots.empty() || !Detect(line, background)) return 0;
  while (peaks_.size() > spots.size()) {
    peaks_.erase(std::min_element(peaks_.begin(), peaks_.end(), [](const auto& a, const auto& b) {
      return a.height < b.height;
    }));
  }
  const std::size_t count = peaks_.size();
  for (std::size_t first = 0; first < count;) {
    const std::size_t last = GroupEnd(first);
    Read(line, first, last, spots.subspan(first, last - first));
    first = last;
  }
  for (std::size_t i = 0; i < count && count > 1; ++i) spots[i].flags |= kSpotSecond;
  std::sort(spots.begin(), spots.begin() + static_cast<std::ptrdiff_t>(count),
            [](const Spot& a, const Spot& b) { return a.u_px < b.u_px; });
  return count;
}

Spot SpotFinder::Find(std::span<const std::uint16_t> line, const Background& background) {
  if (options_.estimator == SpotEstimator::kThresholdedCentroid) return FindFast(line, background);
  if (!Detect(line, background)) return {};
  const auto highest = static_cast<std::size_t>(
      std::max_element(peaks_.begin(), peaks_.end(),
                       [](const auto& a, const auto& b) { return a.height < b.height; }) -
      peaks_.begin());
  std::size_t first = 0, last = GroupEnd(0);
  while (last <= highest) {
    first = last;
    last = GroupEnd(first);
  }
  Spot group[kMostJoint];
  Read(line, first, last, {group, last - first});
  Spot spot = group[highest - first];
  // Do others stand apart from it? Those of its own chain touch it.
  std::size_t chain = 1;
  for (std::size_t i = highest; i > 0 && peaks_[i - 1].touches_next; --i) ++chain;
  for (std::size_t i = highest; peaks_[i].touches_next; ++i) ++chain;
  if (peaks_.size() > chain) spot.flags |= kSpotSecond;
  return spot;
}

}  // namespace unfurl::measure
