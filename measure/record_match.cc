#include "measure/record_match.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "base/error.h"
#include "base/text.h"
#include "data/lab.h"
#include "measure/trial_record.h"

namespace unfurl::measure {

namespace {

constexpr char kOtherRig[] = "give the rig that was calibrated for this camera";

[[noreturn]] void FailUnlike(const std::string& what, const std::string& path) {
  throw Error("is no record to go by: " + what, path,
              "record one with the same cameras, slots and sensors, or leave it out");
}

void RefuseOtherNames(const char* kind, const std::vector<std::string>& mine,
                      const std::vector<std::string>& other, const std::string& path) {
  if (mine == other) return;
  FailUnlike(fmt::format("its {} are {}, not {}", kind, JoinWords(other), JoinWords(mine)), path);
}

void MatchLike(const data::LiveHeader& header, const TrialRecord& like) {
  if (header.readings) {
    if (like.readings() == nullptr) {
      FailUnlike("it holds lines, the stream readings", like.path());
    }
    RefuseOtherNames("slots", header.trial.slots, like.readings()->slots, like.path());
    return;
  }
  if (like.lines() == nullptr) FailUnlike("it holds readings, the stream lines", like.path());
  const data::TrialHeader &mine = header.trial, &other = like.lines()->header();
  RefuseOtherNames("cameras", mine.cameras, other.cameras, like.path());
  RefuseOtherNames("slots", mine.slots, other.slots, like.path());
  for (std::size_t c = 0; c < mine.cameras.size(); ++c) {
    if (other.format.Of(c).elements() == mine.format.Of(c).elements() &&
        other.format.Of(c).first_active() == mine.format.Of(c).first_active()) {
      continue;
    }
    FailUnlike(fmt::format("camera '{}' has other lines", mine.cameras[c]), like.path());
  }
}

}  // namespace

void MatchLines(const data::TrialHeader& header, const std::string& path, const data::Rig& rig,
                const std::string& rig_path) {
  std::vector<std::string> known;
  for (const data::RigCamera& camera : rig.cameras) known.push_back(camera.name);
  if (known != header.cameras) {
    throw Error(fmt::format("was recorded by the cameras {}, but the rig {} has {}",
                            JoinWords(header.cameras), rig_path, JoinWords(known)),
                path, "give the rig that was calibrated for these cameras, in this order");
  }
  for (std::size_t c = 0; c < known.size(); ++c) {
    const int active = header.format.Of(c).active, pixels = rig.cameras[c].pixels;
    if (active == pixels) continue;
    throw Error(
        fmt::format("camera '{}' has lines of {} active pixels, but {} pixels in the rig {}",
                    known[c], active, pixels, rig_path),
        path, kOtherRig);
  }
}

std::vector<int> MatchReadings(const std::vector<std::string>& cameras,
                               const std::vector<int>& pixels, const std::string& path,
                               const data::Rig& rig, const std::string& rig_path) {
  std::vector<std::string> known;
  for (const data::RigCamera& camera : rig.cameras) known.push_back(camera.name);
  std::vector<int> column(known.size(), -1);
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const auto at = std::find(known.begin(), known.end(), cameras[c]);
    if (at == known.end()) {
      throw Error(fmt::format("has readings of a camera '{}', but the rig {} has {}", cameras[c],
                              rig_path, JoinWords(known)),
                  path, "name its cameras as the rig does (in a CSV: # cameras: ..)");
    }
    const auto of_rig = static_cast<std::size_t>(at - known.begin());
    column[of_rig] = static_cast<int>(c);
    const int has = rig.cameras[of_rig].pixels;
    if (!pixels.empty() && pixels[c] > 0 && pixels[c] != has) {
      throw Error(fmt::format("camera '{}' has {} pixels, but {} in the rig {}", cameras[c],
                              pixels[c], has, rig_path),
                  path, kOtherRig);
    }
  }
  return column;
}

void CheckSlots(const std::vector<std::string>& slots, const std::string& path) {
  for (const std::string& name : slots) {
    if (name == data::kDarkSlot) continue;
    std::set<std::string> known;
    for (const std::string& mark : data::MarksOfSlot(name)) {
      if (!mark.empty() && known.insert(mark).second) continue;
      throw Error(fmt::format("slot '{}' names a mark twice, or none", name), path,
                  "name the marks that are lit together, as in mark1+mark2");
    }
  }
}

void MatchStream(const data::LiveHeader& header, const std::string& path, const data::Rig& rig,
                 const std::string& rig_path, const TrialRecord* like) {
  const data::TrialHeader& trial = header.trial;
  if (header.readings) {
    MatchReadings(trial.cameras, header.pixels, path, rig, rig_path);
  } else {
    MatchLines(trial, path, rig, rig_path);
    if (std::count(trial.slots.begin(), trial.slots.end(), data::kDarkSlot) == 0) {
      throw Error("has no dark slot", path,
                  "record with a slot named dark: the background is taken from it");
    }
  }
  CheckSlots(trial.slots, path);
  if (like != nullptr) MatchLike(header, *like);
}

}  // namespace unfurl::measure
