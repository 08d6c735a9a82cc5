#pragma once

#include <string>
#include <vector>

#include "calib/plan.h"
#include "report/page.h"

namespace unfurl::cli {

// Slices of the map, one pane a layer; `high_mm` ends the colours, so that several maps compare
// (NaN: the map's own 98% quantile).
report::Map UncertaintyPanel(const calib::UncertaintyMap& map, const std::string& title,
                             const std::string& note, double high_mm);

// "z = -0.73 m", by layer.
std::vector<std::string> LayerTitles(const calib::UncertaintyMap& map);

// 3-D error with all cameras and with each one lost: share of the volume, median, 95%, largest.
std::vector<std::vector<std::string>> LossTable(const std::vector<calib::PlanCase>& cases);

}  // namespace unfurl::cli
