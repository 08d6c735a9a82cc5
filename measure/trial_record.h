#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "data/live_stream.h"
#include "data/rig.h"
#include "data/tracks.h"
#include "data/trial.h"
#include "data/trial_readings.h"
#include "measure/reconstruct.h"

namespace unfurl::measure {

/// A recorded trial, whichever way it was recorded: raw lines, read in blocks, or readings.
class TrialRecord {
 public:
  /// CSV: readings; HDF5: lines or readings by the file's schema. Throws Error as their readers do.
  explicit TrialRecord(const std::string& path);

  const std::string& path() const { return path_; }  ///< as it was given
  std::size_t size() const;                          ///< lines, or flashes
  double start() const;                              ///< about when the first one was [s]
  double duration() const;                           ///< [s]
  /// Null: it holds readings.
  const data::TrialReader* lines() const { return lines_ ? &*lines_ : nullptr; }
  /// Null: it holds lines.
  const data::TrialReadings* readings() const { return readings_ ? &*readings_ : nullptr; }

  /// As a stream of it begins.
  data::LiveHeader Header() const;

  /// Throws Error where the rig is not the one that recorded it.
  std::unique_ptr<Reconstructor> Open(const data::Rig& rig, const std::string& rig_path,
                                      const ReconstructOptions& options) const;
  /// Lines [first, first + count) through `reconstructor`; `block`, of lines only, keeps them.
  void Process(std::size_t first, std::size_t count, Reconstructor* reconstructor,
               data::TrialBlock* block, data::Tracks* tracks) const;

 private:
  std::string path_;
  std::optional<data::TrialReader> lines_;
  std::optional<data::TrialReadings> readings_;
};

/// The whole record in one call, as that of lines or readings.
data::Tracks Reconstruct(const TrialRecord& record, const data::Rig& rig,
                         const ReconstructOptions& options = {},
                         ReconstructSummary* summary = nullptr, bool correct = false,
                         HealthReport* health = nullptr);

}  // namespace unfurl::measure
