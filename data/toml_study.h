#pragma once

#include <string>
#include <vector>

namespace unfurl::data {

/// A study as TOML with one more trial, a copy of its trial number `like` (from 0) with a name,
/// tracks and overrides of the scene of its own; what that one recorded beside marks, its window
/// and its events are left out, since they are another record's. Files are named as they are seen
/// from the study's own folder. Throws Error.
std::string StudyWithTrial(const std::string& path, const std::vector<std::string>& overrides,
                           std::size_t like, const std::string& name, const std::string& tracks,
                           const std::vector<std::string>& set);

}  // namespace unfurl::data
