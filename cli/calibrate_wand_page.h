#pragma once

#include <string>

#include "calib/wand.h"
#include "data/provenance.h"

namespace unfurl::cli {

// The page of a calibration by a bar: verdict, shape of the volume, the bar's path, residuals by
// camera along pose and row, lengths found in held-out poses.
void WriteCalibrateWandPage(const std::string& path, const std::string& readings,
                            const calib::WandCalibration& result,
                            const data::Provenance& provenance);

}  // namespace unfurl::cli
