#pragma once

#include <string>
#include <vector>

#include "correlate/compare/channel_comparison.h"
#include "data/run.h"
#include "data/study.h"

namespace unfurl::study {

/// Names alone, of channels whose quantities a study states. Throws Error at `where` for one that
/// is given another.
std::vector<std::string> StudyChannelNames(const std::vector<correlate::ChannelName>& channels,
                                           const std::string& where);

/// The instruments of a study's trial against a run of its scene, as the study says that they are:
/// units, gains, biases, clocks and filters known or free. `trial`: its name; empty: the only one
/// with channels. `channels`: of the trial; empty: all. Throws Error for a trial or a channel that
/// is not there, a trial without channels, several where none is named, and as AddChannels.
/// `run_name`: what words call the run.
correlate::Comparison CompareStudy(const data::Study& study, const data::Run& run,
                                   const std::string& run_name, const std::string& trial,
                                   const std::vector<std::string>& channels,
                                   const correlate::ComparisonOptions& options);

}  // namespace unfurl::study
