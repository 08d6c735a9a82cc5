#include "calib/wand_given.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"

namespace unfurl::calib {

std::vector<WandFrame::Planned> PlannedPlaces(const data::Lab& lab) {
  std::vector<WandFrame::Planned> out;
  for (const data::LabCamera& camera : lab.cameras) {
    out.push_back({camera.name, camera.position, camera.look_at});
  }
  return out;
}

std::vector<data::RigCamera> CamerasOf(const data::Rig& rig, const std::vector<std::string>& names,
                                       const std::string& where) {
  std::vector<data::RigCamera> out;
  for (const std::string& name : names) {
    const auto found = std::find_if(rig.cameras.begin(), rig.cameras.end(),
                                    [&](const auto& camera) { return camera.name == name; });
    if (found == rig.cameras.end()) {
      throw Error(fmt::format("holds no camera \"{}\"", name), where,
                  "give a rig of the same cameras, or leave it out");
    }
    out.push_back(*found);
  }
  return out;
}

}  // namespace unfurl::calib
