#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "campaign/campaign.h"
#include "campaign/statistics/rare_failure.h"

namespace unfurl::campaign {

/// The probability of a rare failure, and what speaks against it.
struct RareResult {
  std::string response;  ///< the margin, negative where it failed
  std::string unit;
  std::string method;        ///< that the probability rests on, in words
  double probability = 0.0;  ///< [-]
  double variation = 0.0;    ///< coefficient of variation of it [-]
  Interval interval;         ///< [-]
  double with_failed = 0.0;  ///< if every run without a margin were a failure [-]
  std::size_t runs = 0, failed = 0;
  std::vector<SubsetLevel> levels;  ///< of the subset simulation
  bool usable = true;
  std::string message;             ///< why not
  std::vector<std::string> notes;  ///< what a reader must know
};

/// A campaign of design "rare": step by step, each a batch of parts in a folder of its own, so
/// that what was stopped goes on where it stood. Writes all its runs, with the result, as a record.
/// `progress`: part and words; may throw.
RareResult RunRare(const data::Campaign& plan, const std::string& folder, const JobOptions& job,
                   const EngineOptions& engine, const std::string& out,
                   const std::function<void(double, const std::string&)>& progress);

/// The folders of its batches.
void RemoveRare(const std::string& folder);

/// For machines, and for the record.
nlohmann::ordered_json RareJson(const RareResult& result);

/// Whether a record is of such a campaign.
bool IsRare(const std::string& path);
/// What a record of such a campaign says; throws Error for one that is none.
RareResult ReadRare(const std::string& path);

}  // namespace unfurl::campaign
