#pragma once

#include <string>
#include <vector>

#include "base/error.h"
#include "correlate/observations.h"
#include "correlate/residual/channel.h"
#include "data/run.h"
#include "data/study.h"

namespace unfurl::study {

/// The scene computes no quantity of this name, which a channel records.
class NoQuantity : public Error {
 public:
  /// `names`: of the quantities that there are.
  NoQuantity(const data::StudyChannel& channel, const std::vector<std::string>& names);
  /// Of the channel, and of what it records.
  const std::string& channel() const { return channel_; }
  const std::string& quantity() const { return quantity_; }

 private:
  std::string channel_, quantity_;
};

/// The marks of a trial, as its study wants them, from tracks at `path` (empty: none), and what is
/// known of its clock and frame. Throws Error.
correlate::Observations ReadTrial(const data::StudyTrial& trial, const std::string& path);

/// An instrument without readings: its quantity, what is known of it, and by what its unit differs
/// from the quantity's (null: not known). Throws Error as AddChannels.
correlate::ChannelRecord InstrumentOf(const data::StudyChannel& want, const std::string& unit,
                                      const std::vector<data::Quantity>* quantities);

/// Adds what was recorded beside the marks: channels, in the units of the model's `quantities`
/// (null: not known), switches, times of events. Throws NoQuantity, and Error for a unit that does
/// not measure the same where no gain is stated, a switch without the edge.
void AddChannels(const data::StudyTrial& trial, const std::vector<data::Quantity>* quantities,
                 correlate::Observations* observations);

}  // namespace unfurl::study
