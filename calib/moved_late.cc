#include "calib/moved_late.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/statistics.h"

namespace unfurl::calib {
namespace {

constexpr std::size_t kFewestLate = 2;  // see LastOnes

double LogChoose(std::size_t n, std::size_t k) {
  const auto a = static_cast<double>(n), b = static_cast<double>(k);
  return std::lgamma(a + 1.0) - std::lgamma(b + 1.0) - std::lgamma(a - b + 1.0);
}

}  // namespace

double ChanceOfLast(std::size_t all, std::size_t marked, std::size_t last, std::size_t least) {
  double chance = 0.0;
  for (std::size_t k = least; k <= std::min(marked, last); ++k) {
    if (last - k > all - marked) continue;
    chance +=
        std::exp(LogChoose(marked, k) + LogChoose(all - marked, last - k) - LogChoose(all, last));
  }
  return std::min(1.0, chance);
}

LastOnes LeastLikelyLast(const std::vector<char>& left_out) {
  const auto marked = static_cast<std::size_t>(
      std::count_if(left_out.begin(), left_out.end(), [](char out) { return out != 0; }));
  LastOnes least;
  std::size_t found = 0;
  for (std::size_t last = 1; last <= left_out.size() && found < marked; ++last) {
    if (left_out[left_out.size() - last] == 0) continue;
    ++found;
    if (found < kFewestLate || 2 * found <= last) continue;
    const double chance = ChanceOfLast(left_out.size(), marked, last, found);
    if (chance < least.chance) least = {chance, last, found};
  }
  return least;
}

std::vector<Trend> FindMovedLate(const Observations& data, const RefinedBundle& bundle,
                                 double level) {
  const std::size_t cameras = data.cameras.size();
  std::vector<std::vector<std::size_t>> readings(cameras);
  std::vector<std::vector<char>> left_out(cameras);
  double tests = 0.0;  // each that was left out may be the first since the move
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const auto j = static_cast<std::size_t>(data.readings[k].camera);
    readings[j].push_back(k);
    left_out[j].push_back(bundle.weighting.Uses(k) ? 0 : 1);
    tests += bundle.weighting.Uses(k) ? 0.0 : 1.0;
  }
  std::vector<Trend> out;
  for (std::size_t j = 0; j < cameras; ++j) {
    const LastOnes late = LeastLikelyLast(left_out[j]);
    if (!(late.chance < ChanceOfEach(level, tests))) continue;
    const std::size_t from = readings[j].size() - late.last;
    std::vector<double> off;
    for (std::size_t m = from; m < readings[j].size(); ++m) {
      const double residual = bundle.summary.residual_px[readings[j][m]];
      if (!bundle.weighting.Uses(readings[j][m]) && std::isfinite(residual)) {
        off.push_back(residual);
      }
    }
    Trend trend;
    trend.kind = TrendKind::kReadingDrift;
    trend.camera = static_cast<int>(j);
    trend.chance = late.chance;
    trend.found = true;
    if (!off.empty()) trend.change = Median(off);
    trend.rms = std::abs(trend.change);
    const int first = data.readings[readings[j][from]].point;
    trend.text = fmt::format(
        "camera \"{}\": of its last {} readings, from point \"{}\" on, {} were left out as gross "
        "errors, off by {:+.3g} px (median): it moved, and the rig has it as it stood before. "
        "Survey again, or calibrate with what was measured since it moved",
        data.cameras[j], late.last, data.ids[static_cast<std::size_t>(first)], late.left_out,
        trend.change);
    out.push_back(std::move(trend));
  }
  return out;
}

}  // namespace unfurl::calib
