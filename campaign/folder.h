#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "campaign/inputs.h"
#include "campaign/part.h"

namespace unfurl::campaign {

/// All that the runs of a plan depend on, hashed: the resolved plan but for its name, its place and
/// how many runs are wanted where more can be added; `inputs`' bytes; this program's version.
std::string IdentityOf(const data::Campaign& plan, const std::vector<std::string>& inputs);

/// A part's file in a folder.
struct PartFile {
  RunRange range;
  std::string path;
};

/// Where a campaign lies while it runs: the resolved plan, and a file for each part that is whole.
/// Nothing else keeps state, so that any program on any machine that sees the folder can add to it.
class CampaignFolder {
 public:
  /// Makes the folder, or takes up one of the same identity. Throws Error for one of another.
  static CampaignFolder Make(const std::string& path, const data::Campaign& plan,
                             const std::string& identity);
  /// One that is there.
  static CampaignFolder Open(const std::string& path);

  /// Where it is.
  const std::string& path() const { return path_; }
  /// Of the plan whose runs it holds.
  const std::string& identity() const { return identity_; }
  /// The plan as it was when the folder was made, or when runs were last added.
  data::Campaign ReadPlan() const;
  /// The same, with more runs wanted.
  void WritePlan(const data::Campaign& plan) const;

  /// Of the part with these runs.
  std::string PartPath(const RunRange& range) const;
  std::string LogPath(const std::string& name) const;  ///< of an engine's own files
  /// Those that are there, by first run; of some that begin together the longest first.
  std::vector<PartFile> Parts() const;
  /// What of the runs no part holds.
  std::vector<RunRange> Missing(std::uint64_t runs) const;
  std::uint64_t MissingRuns(std::uint64_t runs) const;  ///< how many those are
  /// Everything that this class and the engines put there, and the folder where nothing else is
  /// left.
  void Remove() const;

  /// Held by whoever runs, merges or removes the whole, so that two do not; computing single parts
  /// needs none. Lasts as long as the object. Throws Error where another program has it.
  class Lock {
   public:
    explicit Lock(const CampaignFolder& folder);
    ~Lock();
    Lock(const Lock&) = delete;
    Lock& operator=(const Lock&) = delete;

   private:
    int file_ = -1;  // descriptor
  };

 private:
  CampaignFolder(std::string path, std::string identity)
      : path_(std::move(path)), identity_(std::move(identity)) {}
  std::string path_, identity_;
};

/// Where the runs of a plan are kept: "boom.runs" for "plans/boom.toml", in the current folder.
std::string DefaultFolder(const std::string& plan);

}  // namespace unfurl::campaign
