#include "study/compare_study.h"

#include <algorithm>

#include "base/error.h"
#include "base/text.h"
#include "study/trial_observations.h"

namespace unfurl::study {
namespace {

const data::StudyTrial& TrialWithChannels(const data::Study& study, const std::string& name) {
  std::vector<std::string> names;
  const data::StudyTrial* found = nullptr;
  for (const data::StudyTrial& trial : study.trials) {
    if (trial.channels.empty()) continue;
    names.push_back(trial.name);
    if (name.empty() || trial.name == name) found = &trial;
  }
  if (names.empty()) {
    throw Error("no trial of the study has channels", study.path,
                "add trial.channel tables, or compare the trial's tracks");
  }
  if (found == nullptr) {
    throw Error("no trial '" + name + "' of the study has channels", study.path,
                "those that do: " + JoinWords(names));
  }
  if (name.empty() && names.size() > 1) {
    throw Error("several trials of the study have channels", study.path,
                "name one: " + JoinWords(names));
  }
  return *found;
}

data::StudyTrial WithChannels(const data::StudyTrial& trial,
                              const std::vector<std::string>& channels) {
  data::StudyTrial out = trial;
  if (channels.empty()) return out;
  const auto is_wanted = [&](const std::string& name) {
    return std::find(channels.begin(), channels.end(), name) != channels.end();
  };
  std::vector<std::string> names;
  for (const data::StudyChannel& channel : trial.channels) names.push_back(channel.name);
  for (const std::string& name : channels) {
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    throw Error("the trial has no channel '" + name + "'", trial.where,
                "it has " + JoinWords(names));
  }
  std::erase_if(out.channels, [&](const auto& channel) { return !is_wanted(channel.name); });
  return out;
}

}  // namespace

std::vector<std::string> StudyChannelNames(const std::vector<correlate::ChannelName>& channels,
                                           const std::string& where) {
  std::vector<std::string> names;
  for (const correlate::ChannelName& channel : channels) {
    if (!channel.of.empty() && channel.of != channel.name) {
      throw Error("the study says which quantity '" + channel.name + "' measures", where,
                  "give its name alone");
    }
    names.push_back(channel.name);
  }
  return names;
}

correlate::Comparison CompareStudy(const data::Study& study, const data::Run& run,
                                   const std::string& run_name, const std::string& trial,
                                   const std::vector<std::string>& channels,
                                   const correlate::ComparisonOptions& options) {
  const data::StudyTrial of = WithChannels(TrialWithChannels(study, trial), channels);
  correlate::Comparison c;
  c.record = study.path;
  c.reference = run_name;
  c.observations = ReadTrial(of, "");
  AddChannels(of, &run.quantities, &c.observations);
  correlate::CompareInstruments(run, options, &c);
  return c;
}

}  // namespace unfurl::study
