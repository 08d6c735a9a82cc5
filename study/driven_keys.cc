#include "study/driven_keys.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"

namespace unfurl::study {

void RefuseDrivenKeys(const std::vector<std::string>& set,
                      const std::vector<data::StudyParameter>& parameters,
                      const std::string& where) {
  for (const std::string& one : set) {
    std::string key = one.substr(0, one.find('='));
    key.erase(key.find_last_not_of(" \t") + 1);
    for (const data::StudyParameter& p : parameters) {
      if (std::find(p.keys.begin(), p.keys.end(), key) == p.keys.end()) continue;
      throw Error(
          fmt::format("'{}' is driven by the parameter {}, whose value would stand", key, p.name),
          where,
          "leave it out, or let other keys differ from trial to trial: parameters are common "
          "to all trials ([repeat] lets them differ)");
    }
  }
}

}  // namespace unfurl::study
