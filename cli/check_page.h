#pragma once

#include <string>

#include "calib/check.h"
#include "data/provenance.h"
#include "data/rig.h"

namespace unfurl::cli {

// The check's page: verdict, misfits by camera and along the sensor, points or lengths of the bar
// where they were found, and what the rest says without each of them.
void WriteCheckPage(const std::string& path, const std::string& input, const data::Rig& rig,
                    const calib::CheckResult& result, bool bar, const data::Provenance& provenance);

}  // namespace unfurl::cli
