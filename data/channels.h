#pragma once

#include <string>
#include <vector>

#include "data/formats.h"

namespace unfurl::data {

/// What an instrument other than a camera recorded: readings at stamps of their own.
struct Channel {
  std::string name;           ///< "encoder"
  std::string unit;           ///< of the readings; empty: the file tells none
  std::string where;          ///< "file", "file:line" or "file:/group", for messages
  std::vector<double> t;      ///< n stamps, ascending, on the file's clock [s]
  std::vector<double> y;      ///< n readings [unit]
  std::vector<double> sigma;  ///< n standard deviations [unit]; empty: none is told
};

/// All channels of a file, by its ending and what is in it; docs/formats.md, "Channels":
/// - CSV, long (columns t [s], channel, value, and if there are unit, sigma) or wide (t [s], a
///   column NAME [unit] each, NAME.sigma beside it; an empty cell is no reading),
/// - universal file 58: functions over time,
/// - HDF5: a run of ours (its quantities), a group for each channel with datasets t, value and
///   sigma, or datasets t, channel, value, unit, sigma of equal length.
/// Throws Error, placed at the file and line, for what is none of these, stamps that do not ascend,
/// values that are not finite.
std::vector<Channel> ReadChannels(const std::string& path);
/// The same of a file whose name does not tell what it is.
std::vector<Channel> ReadChannels(const std::string& path, FileFormat format);

/// Throws Error for stamps that do not ascend, values that are not finite, a sigma for a part.
void CheckChannel(const Channel& channel);

/// The one of that name. Throws Error naming the nearest.
const Channel& FindChannel(const std::vector<Channel>& channels, const std::string& name,
                           const std::string& where);

}  // namespace unfurl::data
