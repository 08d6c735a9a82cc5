#include "measure/survey_readings.h"

#include <limits>
#include <span>

#include "base/worker_pool.h"
#include "measure/spot.h"

namespace unfurl::measure {

void FindSurveyReadings(data::Survey* survey, std::size_t workers) {
  if (!survey->has_lines() || survey->u_px.size() > 0) return;
  const std::size_t n = survey->size();
  const std::size_t cameras = survey->cameras.size();
  const double none = std::numeric_limits<double>::quiet_NaN();
  const auto rows = static_cast<Eigen::Index>(n);
  const auto cols = static_cast<Eigen::Index>(cameras);
  survey->u_px.setConstant(rows, cols, none);
  survey->s_px.setConstant(rows, cols, none);
  ParallelFor(cameras, workers, [&](std::size_t c) {
    const data::LineFormat& format = survey->format.Of(c);
    const auto line = [&](const std::vector<std::uint16_t>& lines, std::size_t i) {
      return std::span<const std::uint16_t>(&lines[survey->LineAt(i, c)], format.elements());
    };
    Background background(format);
    for (std::size_t i = 0; i < n; ++i) background.Add(line(survey->dark, i));
    SpotFinder finder(format);
    if (!survey->response.empty()) {
      finder.SetResponse(
          std::span<const float>(survey->response)
              .subspan(survey->format.ActiveBefore(c), static_cast<std::size_t>(format.active)));
    }
    for (std::size_t i = 0; i < n; ++i) {
      const Spot spot = finder.Find(line(survey->lit, i), background);
      if (!Usable(spot)) continue;
      survey->u_px(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(c)) = spot.u_px;
      survey->s_px(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(c)) = spot.s_px;
    }
  });
}

}  // namespace unfurl::measure
