#include "calib/outermost.h"

#include <fmt/format.h>

#include <cmath>

namespace unfurl::calib {

std::vector<Trend> FindOutermost(const Observations& data, const RefinedBundle& bundle,
                                 const TrendOptions& options) {
  std::vector<Trend> out;
  for (std::size_t j = 0; j < data.cameras.size(); ++j) {
    const double most = options.lens_share * bundle.state.cameras[j].pixels;
    Trend trend;
    int point = -1, count = 0;
    for (std::size_t k = 0; k < data.readings.size(); ++k) {
      const double residual = bundle.summary.residual_px[k];
      if (data.readings[k].camera != static_cast<int>(j) || bundle.weighting.Uses(k)) continue;
      if (!(bundle.redundancy.by_rig[k] > 1.0) || !(std::abs(residual) < most)) continue;
      ++count;
      if (point >= 0 && std::abs(residual) <= std::abs(trend.change)) continue;
      point = data.readings[k].point;
      trend.change = residual;
    }
    if (point < 0) continue;
    trend.kind = TrendKind::kOutermost;
    trend.camera = static_cast<int>(j);
    trend.found = true;
    trend.rms = std::abs(trend.change);
    trend.text = fmt::format(
        "camera \"{}\": the reading of point \"{}\"{} was left out, off by {:+.3g} px, and no "
        "other that takes part is near it on the sensor and says whether it is wrong or the lens "
        "bends otherwise there: error bars may be too short at that end of the volume. Survey more "
        "points around it, or use nothing beyond the others",
        data.cameras[j], data.ids[static_cast<std::size_t>(point)],
        count > 1 ? fmt::format(" (of {} such the one that is off by most)", count) : "",
        trend.change);
    out.push_back(std::move(trend));
  }
  return out;
}

}  // namespace unfurl::calib
