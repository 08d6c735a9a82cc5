#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <vector>

#include "calib/survey_cost.h"
#include "cli/verb.h"

namespace unfurl::cli {

/// `unfurl cost --rig RIG | --survey SURVEY`: what surveying costs, in words and a page.
struct CostRigArguments {
  std::string rig, survey, need, bar, station, point_sigma, lay_out;
  std::vector<std::string> places = {"volume", "levels", "lower"};
  std::vector<double> station_at;  ///< [m]
  calib::SurveyCostOptions cost;

  /// Whether it is this that is asked for.
  bool asked() const { return !rig.empty() || !survey.empty(); }
};

/// Declares their options; each needs --rig or --survey.
void AddCostRigOptions(Verb* verb, CostRigArguments* arguments);
/// Those of these options that were given; empty: none.
std::string CostRigOptionGiven(const CLI::App& app);
/// The exit code; `report` is where the page goes, or empty.
int RunCostRig(const Common& common, CostRigArguments arguments, const std::string& report);

}  // namespace unfurl::cli
