#pragma once

#include <string>
#include <vector>

#include "calib/wand.h"
#include "cli/verb.h"

namespace unfurl::cli {

// `calibrate --wand`: what was typed.
struct WandArguments {
  std::string readings, bar, points, layout, from, lenses, out, report, need, lens, order;
  std::vector<std::string> frame;  // cameras
  calib::WandOptions options;
};

// Its options; those that hold for a survey only are there already, and are refused beside it.
void AddWandOptions(CLI::App* app, VerbFiles& files, WandArguments* wand);

// Calibrates, writes rig and page, prints; the exit code.
int RunCalibrateWand(const Common& common, const WandArguments& arguments);

}  // namespace unfurl::cli
