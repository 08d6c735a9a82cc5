#include "measure/dark_light.h"

#include <algorithm>
#include <cmath>

namespace unfurl::measure {

namespace {

constexpr double kLitReach = 2.0;  // widths of the wider spot that one place is, as in LinesBefore
// The same LED at the same place: half the light, if its flash ends in the next line; no edge of
// the sun's light on a wall, which is wide and, but for what the mean lags behind, not there.
constexpr double kLitFlux = 0.5, kLitWidth = 2.0;

}  // namespace

void DarkLight::Lit(int mark, const Spot* spot, bool only) {
  Last& last = last_[static_cast<std::size_t>(mark)];
  if (spot == nullptr) {
    last = {};
    return;
  }
  last.before_px = last.u_px;
  last.u_px = spot->u_px;
  last.width_px = spot->width_px;
  last.flux = spot->flux;
  last.only = only;
  last.flashes = std::min(last.flashes + 1, 2);
}

int DarkLight::MarkOf(const Spot& spot) const {
  int nearest = -1;
  double least = 0.0;
  for (std::size_t m = 0; m < last_.size(); ++m) {
    const Last& last = last_[m];
    if (last.flashes < 2 || spot.flux < kLitFlux * last.flux) continue;
    if (spot.width_px > kLitWidth * last.width_px) continue;
    const double away = std::abs(spot.u_px - last.u_px);
    const double reach =
        kLitReach * std::max(spot.width_px, last.width_px) + std::abs(last.u_px - last.before_px);
    const bool only = nearest >= 0 && last_[static_cast<std::size_t>(nearest)].only;
    if (away < reach &&
        (nearest < 0 || (last.only && !only) || (last.only == only && away < least))) {
      nearest = static_cast<int>(m);
      least = away;
    }
  }
  return nearest;
}

bool LitDark::Add(double t, std::span<const int> marks) {
  const auto none = std::count_if(marks.begin(), marks.end(), [](int mark) { return mark < 0; });
  if (2 * none >= static_cast<std::ptrdiff_t>(marks.size())) return false;
  for (const int mark : marks) {
    if (mark >= 0) ++votes[static_cast<std::size_t>(mark)];
  }
  if (lines++ == 0) from = t;
  until = t;
  return true;
}

int LitDark::mark() const {
  return static_cast<int>(std::max_element(votes.begin(), votes.end()) - votes.begin());
}

}  // namespace unfurl::measure
