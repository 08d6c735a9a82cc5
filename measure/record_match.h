#pragma once

#include <string>
#include <vector>

#include "data/live_stream.h"
#include "data/rig.h"
#include "data/trial.h"

namespace unfurl::measure {

class TrialRecord;

// Whether this rig recorded it: each throws Error that names both.

// Lines: the same cameras in the same order, with as many pixels.
void MatchLines(const data::TrialHeader& header, const std::string& path, const data::Rig& rig,
                const std::string& rig_path);
// Readings: the rig's cameras in any order, some of them; `pixels` may be empty, or 0 where a
// camera's are not stated. By the rig's cameras, which of these it is; -1: none.
std::vector<int> MatchReadings(const std::vector<std::string>& cameras,
                               const std::vector<int>& pixels, const std::string& path,
                               const data::Rig& rig, const std::string& rig_path);
// Slots that name a mark twice, or none.
void CheckSlots(const std::vector<std::string>& slots, const std::string& path);
// All that the header of a stream tells, before a line of it comes; `like`: LiveBeginning's.
void MatchStream(const data::LiveHeader& header, const std::string& path, const data::Rig& rig,
                 const std::string& rig_path, const TrialRecord* like);

}  // namespace unfurl::measure
