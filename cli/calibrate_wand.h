#pragma once

#include <string>
#include <vector>

#include "calib/wand.h"
#include "cli/verb.h"

namespace unfurl::cli {

// `calibrate --wand`: what was typed.
struct WandArguments {
  std::string readings, bar, points, layout, from, out, report, need;
  std::vector<std::string> frame;  // cameras
  calib::WandOptions options;
};

// Calibrates, writes rig and page, prints; the exit code.
int RunCalibrateWand(const Common& common, const WandArguments& arguments);

}  // namespace unfurl::cli
