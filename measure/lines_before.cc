#include "measure/lines_before.h"

#include <algorithm>
#include <cmath>

#include "base/statistics.h"

namespace unfurl::measure {

namespace {

// Of the wider of two spots: a spot at the limit of detection, six sigmas, lies within a third of
// its width of where it should (three sigmas of it are one width), and full ones are lopsided.
constexpr double kLightReach = 2.0;
// Of the charge that is kept, by line: lines that show more are one in so many.
constexpr double kAlmostAllLines = 0.95;
// Where nothing is seen the brightest light before bounds what is kept: that of a quarter of lines,
// for some marks may be dim.
constexpr double kBrightLines = 0.25;
constexpr double kMargin = 2.0;  // over that: noise, and places where two spots meet
// A sensor that keeps a share r reads (1 - r) r of it with the next line, a quarter at most; what
// is brighter is something else, a lamp that flickers.
constexpr double kMostKept = 0.25;
constexpr std::size_t kEnough = 20;  // lines, of which 95% are at least one less than all

}  // namespace

bool LinesBefore::SamePlace(const Spot& spot, const Light& light) {
  return std::abs(spot.u_px - light.u_px) < kLightReach * std::max(light.width_px, spot.width_px);
}

bool LinesBefore::Explain(const Spot& spot) const {
  return std::any_of(
      light_.begin(), light_.begin() + static_cast<std::ptrdiff_t>(count_),
      [&](const Light& one) { return spot.flux < share_ * one.flux && SamePlace(spot, one); });
}

void LinesBefore::Add(std::span<const Spot> spots) {
  const std::array<Light, kMost> before = light_;
  const std::size_t old = count_;
  count_ = 0;
  for (const Spot& spot : spots.first(std::min(spots.size(), kMost))) {
    light_[count_++] = {spot.u_px, spot.width_px, spot.flux};
  }
  for (std::size_t k = 0; k < old && count_ < kMost; ++k) {
    const bool again = std::any_of(spots.begin(), spots.end(),
                                   [&](const Spot& spot) { return SamePlace(spot, before[k]); });
    if (again) continue;
    light_[count_] = before[k];
    light_[count_++].flux *= share_;
  }
}

void LinesBefore::Learn(std::span<const Spot> spots, const SpotFinder& finder) {
  if (count_ == 0 || spots.empty() || !(light_[0].flux > 0.0)) return;
  const Light& before = light_[0];
  Light wide = before;  // whatever its light meets is no measure of it
  wide.width_px *= kLightReach;
  if (SamePlace(spots[0], wide)) return;
  double kept = 0.0;
  for (const Spot& spot : spots.subspan(1)) {
    if (SamePlace(spot, before)) kept += spot.flux / before.flux;
  }
  if (kept > kMostKept) return;
  seen_.push_back(kept);
  bound_.push_back(kept > 0.0 ? kept : finder.LeastFlux(before.width_px) / before.flux);
}

void LinesBefore::Conclude() {
  if (seen_.size() >= kEnough) {
    share_ = std::max(kMargin * Quantile(seen_, kAlmostAllLines),
                      std::min(least_share_, kMargin * Quantile(bound_, kBrightLines)));
  }
  seen_.clear();
  bound_.clear();
}

}  // namespace unfurl::measure
