#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "campaign/record.h"
#include "campaign/statistics/chaos.h"
#include "campaign/statistics/morris.h"
#include "campaign/statistics/runs_needed.h"
#include "campaign/statistics/sobol_indices.h"
#include "campaign/statistics/summary.h"

namespace unfurl::campaign {

/// How far a response rises or falls with a variable.
struct VariableCorrelation {
  double value = 0.0;  ///< [-]
  Interval interval;   ///< [-]
};

/// What runs say of one response.
struct ResponseAnswer {
  std::string name, unit;
  bool yes_no = false;
  double confidence = 0.95;   ///< of its intervals [-]
  std::uint64_t present = 0;  ///< runs that are good and have it
  std::uint64_t absent = 0;   ///< good runs that do not, such as the time of what did not happen
  double minimum = 0.0, maximum = 0.0;             ///< of those that have it [unit]
  std::uint64_t minimum_run = 0, maximum_run = 0;  ///< the first ones that do
  std::optional<ProportionEstimate> proportion;    ///< of yes or no, where runs are drawn
  /// What P would be if every failed run were a no, and if every one were a yes.
  std::optional<Interval> proportion_with_failed;
  std::optional<Summary> summary;           ///< of numbers, where runs are drawn
  std::optional<RunsEstimate> convergence;  ///< of the probability or the mean
  /// Spearman's rank correlation with each variable, of drawn runs; none where nothing varies.
  std::vector<VariableCorrelation> correlations;
  std::optional<PolynomialChaos> surrogate;  ///< of numbers, where variables are independent
  std::optional<SobolIndices> indices;       ///< of a Saltelli design
  std::optional<MorrisScreening> screening;  ///< of Morris' design
};

/// All that runs say, without new ones.
struct CampaignAnswers {
  std::string name, design;
  double confidence = 0.95;
  std::uint64_t runs = 0, failed = 0;
  std::vector<std::pair<std::string, std::uint64_t>> reasons;  ///< of failures, the commonest first
  std::vector<std::string> variables;                          ///< names
  std::vector<std::string> distributions;                      ///< in words, by variable
  std::vector<ResponseAnswer> responses;
  std::vector<std::string> notes;  ///< what a reader must know
  bool usable = true;
  std::string message;  ///< why not
};

/// Never throws for what the runs are: what cannot be answered says so.
CampaignAnswers Answer(const CampaignRecord& record);

/// The name of a design as plans have it.
const char* DesignName(data::CampaignDesign::Kind kind);

/// Runs of a design that are draws of the distributions, and the block of each: of Saltelli's the
/// first two of a row, else all.
std::vector<std::uint64_t> DrawnRuns(const Inputs& inputs, std::vector<int>* blocks);

}  // namespace unfurl::campaign
