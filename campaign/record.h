#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "campaign/folder.h"
#include "campaign/inputs.h"

namespace unfurl::campaign {

/// Schema of a record's file.
inline constexpr char kCampaignSchema[] = "unfurl/campaign";

/// All runs of a campaign.
struct CampaignRecord {
  data::Campaign plan;  ///< with all that it read from other files
  std::uint64_t runs = 0;
  std::vector<std::vector<double>>
      responses;                      ///< by response, n each; NaN: the run has none [unit]
  std::vector<std::uint64_t> failed;  ///< runs, rising
  std::vector<std::string> messages;  ///< why, likewise
};

/// The parts of a folder as one file, in constant memory but for failures. The bytes do not depend
/// on how the runs were cut into parts, nor on what computed them, nor in which order. Throws Error
/// where runs are missing.
void MergeParts(const CampaignFolder& folder, const Inputs& inputs,
                const std::vector<std::string>& files, const std::string& out);

/// Runs that are there already, as the same file: of a design whose points depend on what came
/// before. `values`: d numbers a run; `rare`: what ReadRareText is to give.
void WriteRecord(const data::Campaign& plan, const std::vector<std::string>& files,
                 const std::vector<std::vector<double>>& values, const CampaignRecord& record,
                 const std::string& rare, const std::string& out);
/// Whether there is such a text; and it.
bool HasRareText(const std::string& path);
std::string ReadRareText(const std::string& path);

/// Throws Error for a file that is none.
CampaignRecord ReadRecord(const std::string& path);

}  // namespace unfurl::campaign
