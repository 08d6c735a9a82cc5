#pragma once

#include <string>
#include <vector>

#include "cli/verb.h"
#include "study/study_cost.h"

namespace unfurl::cli {

/// `unfurl cost STUDY`: what the width of a study's intervals costs, in words and a page.
struct CostStudyArguments {
  std::string study, report;
  std::vector<std::string> sets;
  std::string within;  ///< "60s"; empty: no end
  study::StudyCostOptions cost;
};

/// --within: "60s", "5min", "2h" or a bare number of seconds [s]. Throws Error for no time.
double TimeOption(const std::string& text);

/// The exit code.
int RunCostStudy(const Common& common, const CostStudyArguments& arguments);

}  // namespace unfurl::cli
