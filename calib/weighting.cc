#include "calib/weighting.h"

namespace unfurl::calib {

Weighting EqualWeighting(const Observations& data, double floor_px) {
  Weighting out;
  out.floor_px.assign(data.cameras.size(), floor_px);
  return out;
}

Weighting SelectPoints(const Weighting& weighting, const Observations& all,
                       const std::vector<int>& keep) {
  Weighting out = weighting;
  out.use_reading.clear();
  out.use_survey.clear();
  std::vector<char> kept(static_cast<std::size_t>(all.points()), 0);
  for (const int i : keep) {
    kept[static_cast<std::size_t>(i)] = 1;
    out.use_survey.push_back(weighting.UsesSurvey(static_cast<std::size_t>(i)) ? 1 : 0);
  }
  for (std::size_t k = 0; k < all.readings.size(); ++k) {
    if (kept[static_cast<std::size_t>(all.readings[k].point)] == 0) continue;
    out.use_reading.push_back(weighting.Uses(k) ? 1 : 0);
  }
  return out;
}

}  // namespace unfurl::calib
