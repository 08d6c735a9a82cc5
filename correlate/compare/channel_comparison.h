#pragma once

#include <map>
#include <string>
#include <vector>

#include "correlate/compare/comparison.h"
#include "data/channels.h"

namespace unfurl::correlate {

/// A channel of the record and the one of the reference that it is held against.
struct ChannelName {
  std::string name;  ///< of the record
  std::string of;    ///< of the reference; empty: of the same name
};
/// "gyro=hub.omega", "encoder". Throws Error, placed at `where`, for an empty name.
ChannelName ParseChannelName(const std::string& text, const std::string& where);

/// Whether a file holds channels and nothing that `correlate` would compare mark by mark.
bool HoldsChannels(const std::string& path);
/// Of any record: what a file of channels holds; a run's quantities; of tracks each mark's
/// coordinates, "tip.x" [m]. Throws Error for a file of none of these.
std::vector<data::Channel> ChannelsOf(const std::string& path);

/// Channels of a record beside channels of a reference, at the record's own stamps: the clock found
/// from all of them together, or taken as it is known (`options.placement`), then scores, spectra
/// and modes, each in its unit. `names` empty: those of the same name. Throws Error for names that
/// are not there, for channels whose units do not measure the same, where nothing is in common; a
/// failed alignment is a status of the result.
Comparison CompareChannels(const std::vector<data::Channel>& record,
                           const std::vector<data::Channel>& reference,
                           const std::vector<ChannelName>& names = {},
                           const ComparisonOptions& options = {},
                           const std::string& record_name = "record",
                           const std::string& reference_name = "reference");

/// The same of files, of any record; of a run as the reference it is known that the structure is
/// held before its start, and when it latches.
Comparison CompareChannels(const std::string& record, const std::string& reference,
                           const std::vector<ChannelName>& names = {},
                           const ComparisonOptions& options = {});

/// Stamps at which a reference has each of its quantities [s].
using QuantityTimes = std::map<std::string, std::vector<double>>;

/// The same for instruments (`observations.others`, Channel) and a record of what they read; `c`
/// holds the names and the observations.
void CompareInstruments(const SampledModel& reference, const QuantityTimes& stamps,
                        const ComparisonOptions& options, Comparison* c);
/// The same for a run.
void CompareInstruments(const data::Run& reference, const ComparisonOptions& options,
                        Comparison* c);

/// A record alone: its spectra and modes, of the channels named (empty: all).
Comparison DescribeChannels(const std::vector<data::Channel>& record,
                            const std::vector<std::string>& names = {},
                            const ComparisonOptions& options = {},
                            const std::string& record_name = "record");

}  // namespace unfurl::correlate
