#include "measure/spot_peaks.h"

#include <algorithm>
#include <cmath>

#include "measure/float_pack.h"

namespace unfurl::measure {

namespace {

constexpr float kRise = 6.0F;                 // sigmas that part two hills
constexpr float kFoot = 0.05F;                // of the summit: where a hill is taken to end
constexpr int kSpotPeaksBlock = 4 * kFloats;  // values that are looked at together

// The first index from k on whose value exceeds `level`; n where there is none.
int NextAbove(const float* m, int n, int k, float level) {
  while (k < n) {
    if (k + kSpotPeaksBlock <= n) {
      const FloatPack low = Max(Load(m + k), Load(m + k + kFloats));
      const FloatPack high = Max(Load(m + k + 2 * kFloats), Load(m + k + 3 * kFloats));
      if (!(Highest(Max(low, high)) > level)) {
        k += kSpotPeaksBlock;
        continue;
      }
    }
    const int end = std::min(n, k + kSpotPeaksBlock);
    for (; k < end; ++k) {
      if (m[k] > level) return k;
    }
  }
  return n;
}

// One stretch of light above the ground around k; within it up and down in turn. A turning point
// counts once the line has come back from it by more than noise does. Returns the stretch's end.
int SplitStretch(std::span<const float> m, int k, float ground, const PeakRule& rule,
                 std::vector<SpotPeak>* peaks) {
  const int n = static_cast<int>(m.size());
  const float* v = m.data();
  const auto rise = [&](float value) {
    return kRise * std::sqrt(rule.variance + value / rule.gain);
  };
  int begin = k;
  while (begin > 0 && v[begin - 1] > ground) --begin;
  int summit = k, valley = begin, low = begin;
  bool up = true;
  for (; k < n && v[k] > ground; ++k) {
    if (up) {
      if (v[k] > v[summit]) summit = k;
      if (v[k] < v[summit] - rise(v[summit])) {
        peaks->push_back({.summit = summit, .low = low, .high = k, .height = v[summit]});
        up = false;
        valley = k;
      }
    } else {
      if (v[k] < v[valley]) valley = k;
      if (v[k] > v[valley] + rise(v[k])) {
        peaks->back().high = valley;
        low = valley;
        up = true;
        summit = k;
      }
    }
  }
  if (up) peaks->push_back({.summit = summit, .low = low, .height = v[summit]});
  peaks->back().high = k - 1;
  return k;
}

// Peaks of one stretch reach from valley to valley; this takes their ends in to the foot.
void CutToFoot(const float* v, float ground, std::span<SpotPeak> peaks) {
  for (std::size_t i = 0; i < peaks.size(); ++i) {
    SpotPeak& p = peaks[i];
    const float foot = std::max(kFoot * p.height, ground);
    p.foot = foot / p.height;
    const int left = p.low, right = p.high;
    p.low = p.high = p.summit;
    while (p.low > left && v[p.low] > foot) --p.low;
    while (p.high < right && v[p.high] > foot) ++p.high;
    if (i > 0 && p.low == left && v[left] > foot) peaks[i - 1].touches_next = true;
    if (i + 1 < peaks.size() && p.high == right && v[right] > foot) p.touches_next = true;
  }
}

}  // namespace

void FindPeaks(std::span<const float> m, const PeakRule& rule, std::vector<SpotPeak>* peaks) {
  peaks->clear();
  const int n = static_cast<int>(m.size());
  const float* v = m.data();
  const float ground = 0.5F * rule.threshold;
  for (int k = NextAbove(v, n, 0, rule.threshold); k < n; k = NextAbove(v, n, k, rule.threshold)) {
    const std::size_t first = peaks->size();
    k = SplitStretch(m, k, ground, rule, peaks);
    CutToFoot(v, ground, {peaks->data() + first, peaks->size() - first});
  }
}

}  // namespace unfurl::measure
