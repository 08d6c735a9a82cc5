#pragma once

#include <string>

#include "calib/calibrate.h"
#include "data/provenance.h"

namespace unfurl::cli {

// The calibration's page: verdict, gross errors, residuals by camera, along the sensor and over the
// volume, coverage, worst points, weak directions, lens models compared, map of uncertainty.
void WriteCalibratePage(const std::string& path, const std::string& survey,
                        const calib::Observations& data, const calib::Calibration& result,
                        const data::Provenance& provenance);

}  // namespace unfurl::cli
